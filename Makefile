# One command for each task; each makes the environment it needs.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: grasp test check bench reproduction clean

grasp: .venv/.installed
	$(BIN)/surehold grasp mug

test: .venv/.developer
	$(BIN)/pytest

check: .venv/.developer
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/lint-imports

bench: .venv/.developer
	$(BIN)/python -m benchmarks

reproduction: .venv/.installed
	$(BIN)/python -m surehold.campaigns.reproduction --pack

clean:
	rm -rf .venv

.venv/.created:
	$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "surehold needs Python 3.11 or newer; set PYTHON=")'
	$(PYTHON) -m venv .venv
	touch $@

.venv/.installed: pyproject.toml | .venv/.created
	$(BIN)/pip install --quiet --editable .
	touch $@

.venv/.developer: pyproject.toml | .venv/.created
	$(BIN)/pip install --quiet --editable '.[dev]'
	touch $@ .venv/.installed
