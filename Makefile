# make demo: the main job on the embedded motions.  make test: every test.  Both set up .venv themselves.
PYTHON ?= python3.11
BIN := .venv/bin
BASE := .venv/.base
DEVELOPMENT := .venv/.development
OUT ?= demo-output

export OMP_NUM_THREADS ?= 1
export MPLBACKEND ?= Agg

.PHONY: demo test lint types check docs wheel clean

demo: $(BASE)
	$(BIN)/syda-gym demo --out $(OUT)

test: $(DEVELOPMENT)
	$(BIN)/python -m pytest -n 2 --dist loadfile

lint: $(DEVELOPMENT)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports

types: $(DEVELOPMENT)
	$(BIN)/mypy

check: lint types test docs

docs: $(DEVELOPMENT)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo "open site/index.html"

wheel: $(DEVELOPMENT)
	$(BIN)/python -m build --outdir dist

$(BASE): pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet "torch==2.13.0"
	$(BIN)/python -m pip install --quiet -e .
	touch $@

# Everything that tests, checks and documentation need; extras left out here are tested where they are installed.
$(DEVELOPMENT): $(BASE)
	$(BIN)/python -m pip install --quiet -e ".[dev,docs,train,ik,bvh,live,export]"
	touch $@

clean:
	rm -rf .venv demo-output dist site .pytest_cache .mypy_cache .ruff_cache
