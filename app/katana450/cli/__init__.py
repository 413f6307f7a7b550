"""The command ``katana450``."""


def main() -> int:
    """Run one command and return the exit status."""
    try:
        # Here, because each process of a server imports this file again, and needs nothing of it.
        from katana450.cli.main import main as run

        return run()
    except KeyboardInterrupt:
        return 130
    except RuntimeError as error:
        # So Python reports an interrupt while it creates a class.
        if isinstance(error.__cause__, KeyboardInterrupt):
            return 130
        raise
