"""The note of a study as optuna-dashboard shows it, read and written without loading optuna-dashboard.

Its format: a version that counts up, and the text in pieces of at most 2045 characters, all attributes of the study.
"""

from typing import Final

from optuna.storages import BaseStorage

__all__ = ["read_note", "write_note"]

_VERSION: Final = "dashboard:note_ver"
_PIECE: Final = "dashboard:note_str:"
_LONGEST: Final = 2045


def read_note(backend: BaseStorage, study_id: int) -> str:
    """Return the text (Markdown) of a study's note, empty where there is none."""
    attributes = backend.get_study_system_attrs(study_id)
    count = sum(key.startswith(_PIECE) for key in attributes)
    return "".join(str(attributes.get(f"{_PIECE}{i}", "")) for i in range(count))


def write_note(backend: BaseStorage, study_id: int, text: str) -> None:
    """Replace the text of a study's note."""
    attributes = backend.get_study_system_attrs(study_id)
    before = sum(key.startswith(_PIECE) for key in attributes)
    pieces = [text[i : i + _LONGEST] for i in range(0, len(text), _LONGEST)]
    backend.set_study_system_attr(study_id, _VERSION, int(attributes.get(_VERSION, 0)) + 1)
    for i in range(max(before, len(pieces))):
        backend.set_study_system_attr(study_id, f"{_PIECE}{i}", pieces[i] if i < len(pieces) else "")
