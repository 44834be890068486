# One command for each task; each makes the environment it needs.
PYTHON ?= python3
BIN := .venv/bin
LOWEST := .venv/lowest

.PHONY: grasp test explore check lowest bench reproduction pictures docs clean

grasp: .venv/.installed
	$(BIN)/surehold grasp mug

test: .venv/.developer
	$(BIN)/pytest -n auto

# Tests by property with new random examples, many more of them; before a release.
explore: .venv/.developer
	HYPOTHESIS_PROFILE=explore $(BIN)/pytest -m hypothesis

check: .venv/.developer
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/lint-imports

# The main public paths on the oldest libraries that pyproject.toml allows.
lowest: .venv/.developer
	$(BIN)/uv venv --quiet --clear --python $(BIN)/python $(LOWEST)
	$(BIN)/uv pip install --quiet --system-certs --python $(LOWEST) --resolution lowest-direct '.[all]'
	$(LOWEST)/bin/python .ci/smoke.py

bench: .venv/.developer
	$(BIN)/python -m benchmarks

reproduction: .venv/.installed
	$(BIN)/python -m surehold.campaigns.reproduction --pack

# The README's picture and the numbers beside it, from the program as it is.
pictures: .venv/.developer
	$(BIN)/python docs/pictures.py

# The site in build/site; its gallery runs while it is built, warnings are errors, nothing is fetched.
docs: .venv/.docs
	$(BIN)/python -m sphinx -W --keep-going -b html docs build/site

clean:
	rm -rf .venv

.venv/.created:
	$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "surehold needs Python 3.11 or newer; set PYTHON=")'
	$(PYTHON) -m venv .venv
	touch $@

.venv/.installed: pyproject.toml | .venv/.created
	$(BIN)/pip install --quiet --editable '.[campaign,cli,grasp,report]'
	touch $@

.venv/.developer: pyproject.toml | .venv/.created
	$(BIN)/pip install --quiet --editable '.[dev]'
	touch $@ .venv/.installed

.venv/.docs: pyproject.toml | .venv/.created
	$(BIN)/pip install --quiet --editable '.[docs]'
	touch $@
