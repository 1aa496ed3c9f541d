"""`python -m executor` is `faultline`."""

from executor.cli.main import main

if __name__ == "__main__":
    main()
