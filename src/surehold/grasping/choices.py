"""Names among which a user chooses, public here; they are listed where the command line can read them without us."""

from surehold.choices import CLOSING_MODES, COLLISIONS, CONTACT_MODELS, QUALITIES

__all__ = ["CLOSING_MODES", "COLLISIONS", "CONTACT_MODELS", "QUALITIES"]
