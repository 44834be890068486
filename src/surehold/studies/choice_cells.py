"""Choices as cells of a CSV file, from which each comes back as the choice that it was.

Most are written as their texts. One whose text would be read as nothing (None, blanks), without its ends ("a "), or as
another choice (1 beside "1") is written as JSON: null, "a ", "1" in quotation marks.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any, Final

from optuna.distributions import CategoricalDistribution

from surehold.studies.search_space import SearchSpace

__all__ = ["ChoiceCells"]


class ChoiceCells:
    """The cells of the parameters of a space that are choices.

    Examples
    --------
    >>> from optuna.distributions import CategoricalDistribution
    >>> cells = ChoiceCells(SearchSpace({"grip": CategoricalDistribution([None, "pinch", 1, "1"])}))
    >>> [cells.written("grip", choice) for choice in (None, "pinch", 1, "1")]
    ['null', 'pinch', '1', '"1"']
    >>> [cells.read("grip", cell) for cell in ("null", "pinch", "1", '"1"')]
    [None, 'pinch', 1, '1']
    """

    def __init__(self, space: SearchSpace):
        self._choices: Final[Mapping[str, tuple[Any, ...]]] = {
            name: distribution.choices
            for name, distribution in space.distributions.items()
            if isinstance(distribution, CategoricalDistribution)
        }
        self._cells: Final = {name: _cells(choices) for name, choices in self._choices.items()}

    def written(self, name: str, value: Any) -> Any:
        """Return the cell of a parameter's value; what is none of its choices, and a number, stays as it is."""
        for choice, cell in zip(self._choices.get(name, ()), self._cells.get(name, ()), strict=True):
            if type(choice) is type(value) and (choice is value or choice == value):
                return cell
        return value

    def read(self, name: str, cell: str) -> Any:
        """Return the choice that a cell is; any other cell stays as it is."""
        cells = self._cells.get(name, [])
        return self._choices[name][cells.index(cell)] if cell in cells else cell


def _cells(choices: Sequence[Any]) -> list[str]:
    """Return the cell of each choice, no two the same."""
    texts, data = [str(choice) for choice in choices], [json.dumps(choice) for choice in choices]

    def clear(i: int) -> bool:
        text = texts[i]
        alone = texts.count(text) == 1 and text not in (*data[:i], *data[i + 1 :])
        return choices[i] is not None and alone and text == text.strip() != ""

    return [texts[i] if clear(i) else data[i] for i in range(len(choices))]
