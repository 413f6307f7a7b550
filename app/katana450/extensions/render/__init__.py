"""Pictures and films of the arm without a browser: rays on the processor, the same on every run."""
