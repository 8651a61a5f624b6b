# Every target sets up what it needs; `make` alone lists them.
.DEFAULT_GOAL := help
.PHONY: help setup demo dev test test-full check fix bytes bench load dist clean unit e2e
SHELL := /bin/bash
export UV_PYTHON_DOWNLOADS := never
export PYTHONDONTWRITEBYTECODE := 1

UV    := .tools/bin/uv
BIN   := .venv/bin
PYSRC := wire/python edge-agent relay loadtests tests tools spa/e2e
DEMO  := edge-agent/src/posecast_edge/demo_bundle

help: ## list the targets
	@awk -F':.*## ' '/^[a-z0-9-]+:.*## /{printf "  make %-10s %s\n", $$1, $$2}' Makefile

# ---- what the rest stands on -------------------------------------------------

$(UV): tools/uv-version
	@python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Python 3.11 or newer is needed."; exit 2; }
	@python3 -c 'import ensurepip' 2>/dev/null || tools/need python3-venv
	python3 -m venv .tools
	.tools/bin/python -m pip install --quiet --disable-pip-version-check "uv==$$(cat tools/uv-version)"
	@touch $@

.venv/.ready: $(UV) uv.lock pyproject.toml $(wildcard */pyproject.toml wire/python/pyproject.toml)
	@# the mesh tools' simplifier comes as source
	@tools/need g++
	@tools/need python3-dev
	$(UV) sync --quiet --frozen --all-packages --python "$$(command -v python3)"
	@touch $@

node_modules/.ready: package-lock.json package.json $(wildcard spa/package.json wire/typescript/package.json)
	@node -e 'const [a, b] = process.versions.node.split(".").map(Number); process.exit(a > 20 || (a === 20 && b >= 19) ? 0 : 1)' || { echo "Node 20.19 or newer is needed."; exit 2; }
	@# not `npm ci`: it refuses a lock file without the optional binaries of other platforms, which a mirror may lack
	npm install --silent --no-save --ignore-scripts
	@touch $@

spa/dist/index.html: node_modules/.ready $(shell git ls-files --cached --others --exclude-standard spa/src spa/public spa/index.html spa/vite.config.ts wire/typescript/src 2>/dev/null)
	npm run --silent build -w spa
	@touch $@

$(DEMO)/robot.urdf: .venv/.ready $(shell git ls-files --cached --others --exclude-standard edge-agent/demo 2>/dev/null)
	$(BIN)/python edge-agent/demo/build.py --out $(DEMO)
	@touch $@

$(DEMO)/model/manifest.json: $(DEMO)/robot.urdf $(wildcard edge-agent/src/posecast_edge/model/*.py)
	$(BIN)/posecast-edge model build --no-cache $< -o $(@D)
	@touch $@

setup: .venv/.ready node_modules/.ready spa/dist/index.html $(DEMO)/model/manifest.json ## prepare everything, start nothing

# ---- for people --------------------------------------------------------------

demo: setup ## a robot on http://127.0.0.1:8080 (PORT=…, HOST=0.0.0.0 for the phone in your hand)
	@exec $(BIN)/python tools/demo.py

dev: setup ## the same with the page served by Vite, reloading as you edit
	@exec $(BIN)/python tools/demo.py --vite

# ---- proof -------------------------------------------------------------------

check: .venv/.ready node_modules/.ready ## lint, types, import directions, formats
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy $(PYSRC)
	$(BIN)/lint-imports --no-cache
	$(BIN)/hadolint infra/Dockerfile
	npx --no-install biome check
	npx --no-install tsc -p wire/typescript
	npx --no-install tsc -p spa

fix: .venv/.ready node_modules/.ready ## what the linters can mend by themselves
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	npx --no-install biome check --write

unit: setup ## Python and TypeScript tests without a browser
	@tools/need redis-server
	$(BIN)/pytest -m "not full"
	npm test --silent -w wire/typescript
	npm test --silent -w spa

e2e: setup ## the whole path in a real browser
	@tools/need redis-server
	@tools/need chromium
	npm run --silent e2e -w spa

test: unit e2e ## all tests CI runs (≤ 25 min)

test-full: setup ## the long rest as well
	@tools/need redis-server
	@tools/need chromium
	$(BIN)/pytest
	npm test --silent -w wire/typescript
	npm test --silent -w spa
	npm run --silent e2e -w spa

# ---- figures -----------------------------------------------------------------

bytes: .venv/.ready ## bytes per frame on the shared telemetry sets
	$(BIN)/python wire/python/benches/bytes_per_frame.py

bench: .venv/.ready ## the relay beside a bare send() loop, FastAPI and websockets (needs cc; 20 to 40 minutes)
	$(BIN)/python -m relay.benches.bench

load: setup ## Locust viewers against a relay of their own
	$(BIN)/python -m posecast_loadtests

dist: setup ## wheels (with the page and the demo robot inside) in dist/
	rm -rf relay/src/posecast_relay/page && cp -r spa/dist relay/src/posecast_relay/page
	$(UV) build --quiet --wheel --all-packages --out-dir dist; status=$$?; rm -rf relay/src/posecast_relay/page; exit $$status

clean: ## remove what was made
	rm -rf .venv .tools node_modules spa/dist dist out $(DEMO)
