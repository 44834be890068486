"""What a benchmark is told on its command line: words or numbers, and --help with its description."""

import argparse
from collections.abc import Iterable
from typing import Any


def chosen(doc: str | None, default: Iterable[Any], choices: Iterable[str] = (), name: str = "object") -> list[Any]:
    """Return what the command line names, `default` where it names nothing; numbers where the default is of numbers.

    `doc` is the benchmark's description; `choices` are the words that are known, the default ones if not given.
    """
    usual = list(default)
    known = list(choices) or usual

    def word(text: str) -> str:
        if text not in known:
            raise argparse.ArgumentTypeError(f"unknown {name} {text!r}; give {', '.join(known)}")
        return text

    numeric = all(isinstance(one, int) for one in usual)
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    said = "whole numbers" if numeric else ", ".join(known)
    shown = " ".join(map(str, usual))
    parser.add_argument("chosen", nargs="*", type=int if numeric else word, metavar=name, help=f"{said} ({shown})")
    return parser.parse_args().chosen or usual
