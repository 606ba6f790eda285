# make demo: the main job on the embedded motions.  make test: every test.  Both set up .venv themselves.
PYTHON ?= python3.11
BIN := .venv/bin
BASE := .venv/.base
DEVELOPMENT := .venv/.development
OUT ?= demo-output

export OMP_NUM_THREADS ?= 1
export MPLBACKEND ?= Agg
# Modules are compiled once, and not in each of the hundreds of processes that tests start.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test coverage lowest pythons on-python lint types check docs wheel clean

demo: $(BASE)
	$(BIN)/syda-gym demo --out $(OUT)

# Three at a time on two cores: tests wait for browsers, signals and robots that ease home.
test: $(DEVELOPMENT)
	$(BIN)/python -m pytest -n 3 --dist loadfile --no-loadscope-reorder

# Lines and branches of the package that the tests reach, as a table and as coverage/index.html.
coverage: $(DEVELOPMENT)
	$(BIN)/python -m pytest -n 2 --dist loadfile --cov --cov-report=term-missing:skip-covered --cov-report=html:coverage

ROOMS := tests/embodiments tests/motions tests/mappings tests/simulation tests/envs tests/teleoperation tests/agents tests/cli

# The tests of most rooms with the lowest versions that pyproject.toml allows.
LOWEST := .venv/lowest
lowest: $(BASE)
	$(PYTHON) -m venv --clear $(LOWEST)
	$(LOWEST)/bin/python -m pip install --quiet uv "torch==2.13.0"
	$(LOWEST)/bin/uv pip install --quiet --python $(LOWEST)/bin/python --resolution lowest-direct \
		-e ".[dev,train,ik,live,camera,view,export]"
	$(LOWEST)/bin/python -m pytest -p no:cacheprovider $(ROOMS)

# Other versions of Python that this machine has, pyenv's too: every file compiles with them.
OTHER_PYTHONS = $(foreach version,3.12 3.13,$(firstword $(shell python$(version) -c "import sys; print(sys.executable)" 2> /dev/null) \
	$(wildcard $(HOME)/.pyenv/versions/$(version).*/bin/python$(version))))
pythons:
	@echo "other versions of Python on this machine: $(or $(strip $(OTHER_PYTHONS)),none)"
	@for python in $(OTHER_PYTHONS); do \
		$$python -W error -c "import pathlib; [compile(p.read_text(), str(p), 'exec') for r in ('syda_gym', 'scripts', 'examples', 'tests') \
			for p in pathlib.Path(r).rglob('*.py')]" || exit 1; \
	done

# The tests of most rooms with one of them, for example make on-python PYTHON=python3.13: about twenty minutes, for PyBullet is compiled.
on-python:
	$(PYTHON) -m venv --clear .venv/other
	.venv/other/bin/python -m pip install --quiet "torch==2.13.0"
	.venv/other/bin/python -m pip install --quiet -e ".[dev,train,ik,live,camera,view,export]"
	.venv/other/bin/python -m pytest -n 2 --dist loadfile -p no:cacheprovider $(ROOMS)

lint: $(DEVELOPMENT)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports

types: $(DEVELOPMENT)
	$(BIN)/mypy

check: lint types test docs

docs: $(DEVELOPMENT)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo "open site/index.html; its search wants a server: $(BIN)/python -m http.server --directory site"

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
	$(BIN)/python -m pip install --quiet -e ".[dev,docs,train,ik,live,camera,view,naoqi,export,c3d,ros,mjcf,xacro,robots]"
	touch $@

clean:
	rm -rf .venv demo-output dist site coverage .pytest_cache .mypy_cache .ruff_cache
