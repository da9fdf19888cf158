# make demo: identify joints, write reports.   make test: every test that this machine has data and tools for.
# make nightly: tests, and what takes too long for every run: the blocks of every tutorial, and every proof.
# Each sets everything up by itself: the demo only what Pellucid needs, tests and all others what is tested and measured too.
PYTHON ?= python3
VENV   ?= .venv
DEMO   ?= demo
BIN    := $(VENV)/bin
# A file's tests stay in one process, for they share what they make; a process per core leaves none for BLAS's threads.
# Files in their order: by how many tests they have, the long ones with few would come last, one process waiting.
PYTEST   := OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest
PARALLEL := -n auto --dist loadfile --no-loadscope-reorder
# Tests of an engine in real time, which runs with nothing beside it.
REAL_TIME = $(shell grep -l 'mark.real_time' tests/unit/test_*.py)
# Tests whose figures another BLAS kernel rounds otherwise.
ARRAYS  = numerics|people|models\.(parameter|estimates)|joint\.(fit|slider)|arm\.(fit|tree_motion)|orthosis\.(strap|swing|transfer|imu)
NUMERIC = tests/property tests/real \
  $(shell grep -lE 'pellucid\.($(ARRAYS)|emg\.(estimators|signals|fit|cocontraction))' tests/unit/test_*.py)
CORE   := $(wildcard include/pellucid/*.hpp bindings/*.cpp bindings/*.hpp engine/*.cpp engine/*.hpp) CMakeLists.txt pyproject.toml lab/pyproject.toml

.PHONY: demo test nightly refresh-pages refresh-notebooks core-test numeric-test fuzz bench evidence wheels reference site clean

demo: $(VENV)/.installed
	$(BIN)/pellucid demo --out $(DEMO)

test: $(VENV)/.tested core-test
	$(BIN)/ruff check .
	$(BIN)/python -m compileall -q src/pellucid lab/src/pellucid_lab research
	$(PYTEST) $(PARALLEL) -m 'not nightly and not real_time'
	$(PYTEST) -m 'real_time and not nightly' $(REAL_TIME)

nightly: test
	$(PYTEST) $(PARALLEL) -m 'nightly and not real_time'
	$(PYTEST) -m 'nightly and real_time' $(REAL_TIME)

# Write what the program prints now into the pages, where they show something else. Look at the difference after it.
refresh-pages: $(VENV)/.tested
	PELLUCID_REFRESH_PAGES=1 $(PYTEST) -m '' -k test_blocks_run_as_written tests/rules/test_tutorials.py

# Run the notebooks and store what they show now. A folder of their own takes the files that they write.
refresh-notebooks: $(VENV)/.tested
	$(BIN)/uv pip install -q --python $(BIN)/python -r pyproject.toml --extra site
	rm -rf build/notebooks && mkdir -p build/notebooks && cp examples/*.ipynb build/notebooks
	$(BIN)/jupyter nbconvert --to notebook --execute --inplace --ExecutePreprocessor.record_timing=False build/notebooks/*.ipynb
	cp build/notebooks/*.ipynb examples

numeric-test: $(VENV)/.tested
	$(PYTEST) $(PARALLEL) -q -m 'not slow and not nightly and not real_time' $(NUMERIC)

core-test: $(VENV)/.tested
	$(BIN)/cmake -G Ninja -S tests/core -B build/core -DCMAKE_MAKE_PROGRAM=$(abspath $(BIN))/ninja >/dev/null
	$(BIN)/cmake --build build/core
	$(BIN)/ctest --test-dir build/core -j 2 --output-on-failure

# Needs clang++; FUZZ_SECONDS for each controller.
fuzz: $(VENV)/.tested
	$(BIN)/cmake -G Ninja -S tests/core -B build/fuzz -DCMAKE_MAKE_PROGRAM=$(abspath $(BIN))/ninja \
	  -DCMAKE_CXX_COMPILER=clang++ -DFUZZ=ON -DFUZZ_SECONDS=$(or $(FUZZ_SECONDS),10) >/dev/null
	$(BIN)/cmake --build build/fuzz --target fuzz

bench: $(VENV)/.tested
	$(BIN)/uv pip install -q --python $(BIN)/python -r pyproject.toml --extra benchmark
	$(BIN)/python -m research.benchmarks

# Proofs of what is claimed besides speed: make evidence PROOFS="coverage scale" for some of them.
evidence: $(VENV)/.tested
	$(BIN)/python -m research.evidence $(PROOFS) --out $(or $(EVIDENCE),evidence.json)

# Both distributions' wheels in dist/; packaging/README.md says more.
wheels: $(VENV)/.installed
	packaging/wheels.sh

# Reference pages that are made of the code, in build/reference.
reference: $(VENV)/.installed
	$(BIN)/python website/generated.py --out build/reference

# The site in build/site, with reports that the demo writes for its gallery; pictures of them need chromium.
site: reference
	$(BIN)/uv pip install -q --python $(BIN)/python -r pyproject.toml --extra site
	rm -rf build/gallery && $(BIN)/pellucid demo --out build/gallery >/dev/null
	-command -v chromium >/dev/null && for page in $$(find build/gallery -name index.html); do chromium --headless --no-sandbox --disable-gpu \
	  --hide-scrollbars --window-size=1100,1400 --screenshot=$${page%index.html}page.png file://$(CURDIR)/$$page 2>/dev/null; done
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build -q -f website/mkdocs.yml

# What builds the core comes into an environment of its own and is gone afterwards. Modules are compiled once, as pip does it: where
# Python is told to keep no bytecode, each process would otherwise compile all that it imports, which takes ten seconds of a demo.
$(VENV)/.installed: $(CORE)
	test -x $(BIN)/uv || ($(PYTHON) -m venv $(VENV) && $(BIN)/pip install -q uv)
	$(BIN)/uv pip install -q --compile-bytecode --python $(BIN)/python -e . -e ./lab --reinstall-package pellucid
	$(BIN)/python -m compileall -q src/pellucid lab/src/pellucid_lab
	touch $@

# Libraries alone: to name the package with its extra, -e '.[test]', would build it again.
$(VENV)/.tested: pyproject.toml | $(VENV)/.installed
	$(BIN)/uv pip install -q --compile-bytecode --python $(BIN)/python -r pyproject.toml --extra test
	touch $@

clean:
	rm -rf build .venv .venv-*
