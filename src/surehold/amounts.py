"""Numbers of things in words."""

__all__ = ["amount"]


def amount(number: int, noun: str) -> str:
    """Return a number of things that form their plural with an s.

    >>> amount(1, "trial"), amount(1200, "trial")
    ('1 trial', '1,200 trials')
    """
    return f"{number:,} {noun}{'s' * (number != 1)}"
