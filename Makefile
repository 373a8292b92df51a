# make demo | test | lint | clean: each sets up what it needs in .venv, from nothing but Python >= 3.11.
# A second run finds the stamps and starts at once.

VENV := .venv
PY := $(VENV)/bin/python
OUT := outputs/demo
# Whoever has a preferred interpreter: make demo PYTHON=/path/to/python3.12
PYTHON := $(shell for p in python3 python3.14 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && { echo $$p; break; }; done)

.PHONY: demo test lint clean

demo: $(VENV)/core.stamp
	$(VENV)/bin/steer-env demo --out $(OUT)

test: lint
	$(PY) -m pytest -q -n 2

lint: $(VENV)/dev.stamp
	$(PY) -m ruff check .
	$(PY) -m mypy $(wildcard steer_env controllers identification experiments)

clean:
	rm -rf $(VENV) build dist *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# uv is quick; where it finds no way to the packages that pip finds (a proxy, a mirror), pip does it.
install = echo "Installing $(1) ..." && { $(VENV)/bin/uv pip install -q --python $(PY) -e '$(1)' \
	|| $(PY) -m pip install -q -e '$(1)'; }

$(VENV)/core.stamp: pyproject.toml | $(VENV)/bin/uv
	@$(call install,.)
	@touch $@

$(VENV)/dev.stamp: pyproject.toml | $(VENV)/bin/uv
	@$(call install,.[dev])
	@touch $@ $(VENV)/core.stamp

$(VENV)/bin/uv:
	@test -n "$(PYTHON)" || { echo "No Python 3.11 or newer found. Install one:" \
		"'sudo apt install python3 python3-venv' (Debian, Ubuntu), 'brew install python' (macOS)."; exit 1; }
	@$(PY) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null \
		&& $(PY) -m pip --version >/dev/null 2>&1 \
		|| $(PYTHON) -m venv --clear $(VENV) >/dev/null 2>&1 \
		|| { $(PYTHON) -m venv --clear --without-pip $(VENV) >/dev/null 2>&1 \
			&& $(PYTHON) -m pip --python $(PY) install -q pip 2>/dev/null; } \
		|| { rm -rf $(VENV); echo "$(PYTHON) cannot make a virtual environment. Install its venv" \
			"module ('sudo apt install python3-venv' on Debian, Ubuntu), then run make again."; exit 1; }
	@$(PY) -m pip install -q --disable-pip-version-check uv
