# `make train` trains a scheduler and compares it, `make test` runs the tests; both set up .venv first.
PYTHON ?= python3
SCENARIO ?= PreDC-v0
# Left out: every trade-off of the scenario.
LAM ?=
# An index of CPU wheels of torch, where the default index would bring a CUDA build: TORCH_INDEX="--index-url URL"
TORCH_INDEX ?=

# A process of tests for each core.
PARALLEL ?= -n auto --dist loadgroup

VENV := .venv
PIP := --quiet --disable-pip-version-check --no-compile
RUN := $(VENV)/bin/python
READY := $(VENV)/.ready
LINKS := out/types

.PHONY: train pretrained test slow examples bench bench-short figures figures-trained docs lint package clean

train: $(READY)
	$(RUN) train.py --resume --scenario $(SCENARIO) $(if $(LAM),--lam $(LAM))

# The policies that come with the package, trained again; two hours.
pretrained: $(addprefix pretrained-,PreDC-v0 Rssi-v0 Binary-v0 Anchors-v0 Underwater-v0 Ble-v0 Lifetime-v0)

BIG_BATCHES := --epochs 8 --batch 4096
SHORT_RETURNS := --gamma 0.95 --gae-lambda 0.7
pretrained-PreDC-v0: STEPS := 12000000
pretrained-Rssi-v0: STEPS := 12000000
pretrained-Rssi-v0: MORE := $(SHORT_RETURNS) $(BIG_BATCHES) --even-worlds False
pretrained-Binary-v0: STEPS := 4000000
pretrained-Binary-v0: MORE := --reward error --gae-lambda 0.95 $(BIG_BATCHES)
pretrained-Anchors-v0: STEPS := 2000000
pretrained-Anchors-v0: MORE := $(BIG_BATCHES)
pretrained-Underwater-v0: STEPS := 3000000
pretrained-Underwater-v0: MORE := $(SHORT_RETURNS) $(BIG_BATCHES)
pretrained-Ble-v0: STEPS := 2000000
pretrained-Ble-v0: MORE := $(SHORT_RETURNS) $(BIG_BATCHES) --even-worlds False --set particles=400
pretrained-Lifetime-v0: STEPS := 6000000
pretrained-Lifetime-v0: MORE := $(SHORT_RETURNS) $(BIG_BATCHES) --even-worlds False --set battery_j=0.0005..0.004 \
	--vary nodes=113 nodes=450 motion=turns motion=walk motion=waypoint,speed_ms=0.5
pretrained-%: $(READY)
	$(RUN) train.py --resume --runs out/pretrained --scenario $* --steps $(STEPS) $(MORE) --episodes 0
	mkdir -p agents/pretrained/$*
	cp out/pretrained/$*/policy.json out/pretrained/$*/policy.safetensors agents/pretrained/$*/

test: $(READY)
	$(RUN) -m pytest $(PARALLEL) $(if $(SLOW),-m "not full")

# The studies that `make test` leaves out, a few minutes; `make test SLOW=1` runs all but those with a short form.
slow: $(READY)
	$(RUN) -m pytest $(PARALLEL) -m slow

# Every toolkit's example for three seeds, in a virtual environment of its own, 40 minutes, half of it pip's; renews docs/toolkits.md.
examples: $(READY)
	$(RUN) -m examples --torch-index "$(TORCH_INDEX)"

# Every claim about speed against its peers, some ten minutes; renews docs/performance.md.
bench: $(VENV)/.bench
	$(RUN) -m benchmarks

# A glance at the shorter of the same claims, a minute, with the peers that are there; docs/performance.md stays.
bench-short: $(READY)
	$(RUN) -m benchmarks --short

$(VENV)/.bench: $(READY)
	$(RUN) -m pip install $(PIP) -c constraints.txt -e ".[test,bench]"
	touch $@

# Every table and picture of the pages that a command makes and that needs no training; an hour.
figures: $(READY)
	$(RUN) docs/figures.py

# Those of policies that have to be trained first; another hour.
figures-trained: $(READY)
	$(RUN) docs/figures.py faults

# The documentation site, warnings as errors; out/docs/index.html.
docs: $(VENV)/.docs
	$(VENV)/bin/sphinx-build -q -W --keep-going -b html docs out/docs

$(VENV)/.docs: $(READY)
	$(RUN) -m pip install $(PIP) -c constraints.txt -e ".[test,docs]"
	touch $@

# mypy sees the package as it is installed, with `agents` in it, through links.
lint: $(READY)
	$(VENV)/bin/ruff check . && $(VENV)/bin/ruff format --check .
	rm -rf $(LINKS) && mkdir -p $(LINKS)/wsn_env
	ln -s $(CURDIR)/wsn_env/* $(CURDIR)/agents $(LINKS)/wsn_env && ln -s $(CURDIR)/train.py $(LINKS)
	cd $(LINKS) && $(CURDIR)/$(VENV)/bin/mypy --config-file $(CURDIR)/pyproject.toml --cache-dir $(CURDIR)/out/mypy wsn_env train.py

# Wheel and source distribution, and what an installation of the wheel brings (a bill of materials, CycloneDX), in out/package.
package:
	rm -rf out/package out/tools out/plain
	$(PYTHON) -m venv out/tools && $(PYTHON) -m venv out/plain
	out/tools/bin/python -m pip install $(PIP) build cyclonedx-bom
	out/tools/bin/python -m build --outdir out/package .
	out/plain/bin/python -m pip install $(PIP) out/package/*.whl
	out/tools/bin/cyclonedx-py environment out/plain/bin/python --output-file out/package/sbom.json

$(READY): pyproject.toml constraints.txt Makefile
	$(PYTHON) -m venv $(VENV)
	$(RUN) -m pip install $(PIP) torch==2.13.0 $(TORCH_INDEX) -c constraints.txt
	$(RUN) -m pip install $(PIP) -c constraints.txt -e ".[test]"
	$(RUN) -m wsn_env compile
	touch $@

clean:
	rm -rf $(VENV) build *.egg-info
