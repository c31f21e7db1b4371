"""The command line: a module per command, each of which parses, calls and prints."""

import sys


def main() -> None:
    """Run the command line; an error is one line on standard error and exit status 2."""
    try:
        # Here, so that an interrupt while importing ends as quietly as any other.
        from palpate.cli.application import run

        run(sys.argv[1:])
    except KeyboardInterrupt:
        sys.exit(130)
