# make demo: the main job on the embedded motions.  make test: every test.  Both set up .venv themselves.
PYTHON ?= python3.11
BIN := .venv/bin
INSTALLED := .venv/.installed
OUT ?= demo-output

export OMP_NUM_THREADS ?= 1
export MPLBACKEND ?= Agg

.PHONY: demo test lint types check docs wheel clean

demo: $(INSTALLED)
	$(BIN)/syda-gym demo --out $(OUT)

test: $(INSTALLED)
	$(BIN)/python -m pytest -n 2 --dist loadfile

lint: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports

types: $(INSTALLED)
	$(BIN)/mypy

check: lint types test docs

docs: $(INSTALLED)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo "open site/index.html"

wheel: $(INSTALLED)
	$(BIN)/python -m build --outdir dist

$(INSTALLED): pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet "torch==2.13.0"
	$(BIN)/python -m pip install --quiet -e ".[dev,docs,train,ik,bvh,live,export]"
	touch $@

clean:
	rm -rf .venv demo-output dist site .pytest_cache .mypy_cache .ruff_cache
