"""The health check of a container: exit status 0 if the server in it answers that it is well."""

from __future__ import annotations

import ssl
import sys
import urllib.request
from argparse import ArgumentParser
from pathlib import Path

from katana450.cli.serve import local_url
from katana450.settings import Settings

TIMEOUT = 2.0
"""[s] Timeout for the answer."""


def url_of(process: int) -> str:
    """Return the address of the server whose command line is that of ``process``."""
    words = Path(f"/proc/{process}/cmdline").read_text(encoding="utf-8").split("\0")
    parser = ArgumentParser(add_help=False)
    parser.add_argument("--host", default=Settings.host)
    parser.add_argument("--port", type=int, default=Settings.port)
    parser.add_argument("--tls-cert", type=Path)
    options = parser.parse_known_args(words)[0]
    settings = Settings(host=options.host, port=options.port, tls_cert=options.tls_cert)
    return local_url(settings, settings.port)


if __name__ == "__main__":
    # The first process of a container is the server, or an init process that names its command.
    url = url_of(int(sys.argv[1]) if len(sys.argv) > 1 else 1)
    # The certificate is that of the public name, and the request stays inside the container.
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    try:
        with urllib.request.urlopen(f"{url}/health", timeout=TIMEOUT, context=context):
            print(f"{url} is well.")
    except OSError as error:
        sys.exit(f"{url} is not well: {error}")
