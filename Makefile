# Every target prepares what it needs; `make` alone lists the targets.
.DEFAULT_GOAL := help
.PHONY: help setup demo dev test test-full check fix fuzz mutants bytes bench peers lane balance load attack faults soak gallery pictures explained prose site compose-test dist bare clean unit python typescript page e2e browsers
SHELL := /bin/bash
export UV_PYTHON_DOWNLOADS := never
# bytecode is kept, but not in the sources
unexport PYTHONDONTWRITEBYTECODE
export PYTHONPYCACHEPREFIX := $(CURDIR)/out/pyc
# tests start hundreds of short processes: compile their libraries once
export UV_COMPILE_BYTECODE := 1

UV    := .tools/bin/uv
BIN   := .venv/bin
PYSRC := wire/python edge-agent relay command/src command/tests benches testing loadtests fuzz tests tools spa/e2e
ENGINES   := chromium firefox webkitgtk
E2E_NEEDS := redis-server chromium firefox-esr webkit2gtk-driver xvfb
DEMO  := edge-agent/src/posecast_edge/demo_bundle
DIST  ?= dist
# more processes than cores, because most tests wait
PYTEST := $(BIN)/pytest --numprocesses 6 --dist worksteal
PYTHON_NEEDS := for package in redis-server nginx rsync prometheus; do tools/need $$package || exit; done
E2E    := npm run --silent e2e -w spa -- --retry=1

help: ## list the targets
	@awk -F':.*## ' '/^[a-z0-9-]+:.*## /{printf "  make %-12s %s\n", $$1, $$2}' Makefile

# ---- prerequisites -----------------------------------------------------------

$(UV): tools/uv-version
	@python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Python 3.11 or newer is needed."; exit 2; }
	@python3 -c 'import ensurepip' 2>/dev/null || tools/need python3-venv
	@echo "set up: uv, which installs Python packages"
	@python3 -m venv .tools
	@.tools/bin/python -m pip install --quiet --disable-pip-version-check "uv==$$(cat tools/uv-version)"
	@touch $@

.venv/.ready: $(UV) uv.lock pyproject.toml $(wildcard */pyproject.toml wire/python/pyproject.toml)
	@# the mesh tools' simplifier comes as source
	@tools/need g++
	@tools/need python3-dev
	@echo "set up: Python packages"
	@$(UV) sync --quiet --frozen --all-packages --python "$$(command -v python3)"
	@touch $@

node_modules/.ready: package-lock.json package.json $(wildcard spa/package.json wire/typescript/package.json)
	@node -e 'const [a, b] = process.versions.node.split(".").map(Number); process.exit(a > 20 || (a === 20 && b >= 19) ? 0 : 1)' || { echo "Node 20.19 or newer is needed."; exit 2; }
	@# not `npm ci`: it refuses a lock file without the optional binaries of other platforms, which a mirror may lack
	@echo "set up: npm packages"
	@npm install --silent --no-save --ignore-scripts
	@touch $@

spa/dist/index.html: node_modules/.ready $(shell git ls-files --cached --others --exclude-standard spa/src spa/public spa/index.html spa/vite.config.ts spa/pack.mjs wire/typescript/src 2>/dev/null)
	@echo "set up: the page"
	@npm run --silent build -w spa -- --logLevel warn
	@touch $@

$(DEMO)/robot.urdf: .venv/.ready $(shell git ls-files --cached --others --exclude-standard edge-agent/demo 2>/dev/null)
	@echo "set up: the demo robot"
	@$(BIN)/python edge-agent/demo/build.py --out $(DEMO)
	@touch $@

$(DEMO)/model/manifest.json: $(DEMO)/robot.urdf $(wildcard edge-agent/src/posecast_edge/model/*.py edge-agent/src/posecast_edge/model/*/*.py)
	@$(BIN)/posecast-edge model build --no-cache $< -o $(@D)
	@touch $@

# inside the page's folder, where the relay finds it; compressed like the page. Its gallery shows the demo robot
spa/dist/guide/index.html: spa/dist/index.html $(DEMO)/model/manifest.json .venv/.ready $(shell git ls-files --cached --others --exclude-standard docs tools/site zensical.toml '*.md' 2>/dev/null)
	@echo "set up: the guide"
	@$(BIN)/python -m tools.site --out out/site
	@rm -rf $(@D) && cp -r out/site $(@D)
	@node spa/pack.mjs $(@D)
	@touch $@

setup: .venv/.ready node_modules/.ready spa/dist/index.html spa/dist/guide/index.html $(DEMO)/model/manifest.json ## install and build everything, start nothing

# ---- for people --------------------------------------------------------------

demo: setup ## a robot on http://127.0.0.1:8080, or the next free port (PORT=…; HOST=0.0.0.0 to open it on your phone)
	@exec $(BIN)/posecast demo $(if $(HOST),--host $(HOST)) $(if $(PORT),--port $(PORT))

dev: setup ## the same, with the page served by Vite and reloaded as you edit
	@exec $(BIN)/python tools/dev.py

site: spa/dist/guide/index.html ## the guide (docs/) as a static site: out/site for any web server, and /guide/ on the relay

# ---- tests -------------------------------------------------------------------

check: setup ## lint, types, import directions, formats, wording of the docs, known vulnerabilities
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy $(PYSRC)
	$(BIN)/lint-imports --no-cache
	$(BIN)/hadolint infra/Dockerfile
	@said=$$(XDG_DATA_HOME=$$(mktemp -d) $(BIN)/caddy validate --config infra/Caddyfile --adapter caddyfile 2>&1) || { echo "$$said"; exit 1; }
	$(BIN)/kubernetes-validate --strict --quiet $(filter-out %/kustomization.yaml,$(wildcard infra/cloud/kubernetes/*.yaml))
	npx --no-install biome check
	@# the words of the documentation, but of pages whose turn has not come
	npx --no-install textlint --ignore-path tools/prose/unfinished.txt README.md CONTRIBUTING.md 'docs/**/*.md'
	npx --no-install tsc -p wire/typescript
	npx --no-install tsc -p spa
	npx --no-install tsc -p spa/tsconfig.pure.json
	npx --no-install tsc -p fuzz/page
	@UV=$(UV) tools/audit
	@# the documentation against files and parsers: no program is started
	$(BIN)/pytest --quiet -m docs tests command/tests

prose: .venv/.ready ## readability of each docs page: words, median and longest sentence, reading ease
	$(BIN)/python -m tools.prose

explained: .venv/.ready ## write the docs' tables of explained terms from the page's own sentences
	$(BIN)/python -m tools.explained

fix: .venv/.ready node_modules/.ready ## fix what the linters can fix automatically
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	npx --no-install biome check --write

unit: python typescript fuzz ## tests without a browser

python: setup
	@$(PYTHON_NEEDS)
	@# compiled once, not by each process, and not by one whose memory or time is measured
	@$(BIN)/python -m compileall -q $(wildcard */src) wire/python/src
	@$(BIN)/pytest --collect-only > out/collected || { cat out/collected; exit 1; }
	$(PYTEST) -m "not full and not docs"

typescript: setup
	npm test --silent -w wire/typescript
	npm test --silent -w spa

e2e: setup ## end-to-end tests in real browsers: all in Chromium, a smoke test in Firefox and WebKitGTK
	@for package in $(E2E_NEEDS); do tools/need $$package || exit; done
	$(E2E)
	POSECAST_ENGINE=firefox $(E2E) smoke browsers
	POSECAST_ENGINE=webkitgtk $(E2E) smoke browsers

fuzz: .venv/.ready node_modules/.ready ## untrusted bytes into every parser at a boundary (SECONDS=3600 for an hour)
	$(BIN)/python -m fuzz --seconds $(or $(SECONDS),60)

mutants: setup ## plant faults in product code, one at a time, and see the tests catch each
	$(BIN)/python -m tools.mutants --check

# one after the other, because each fills the cores
test: SECONDS := 30
test: python page fuzz ## all tests that CI runs

page: typescript e2e

test-full: setup ## also the slow tests, and every browser test in each of the three engines
	@for package in $(E2E_NEEDS) nginx varnish rsync; do tools/need $$package || exit; done
	@# and says what was skipped, and why
	POSECAST_FULL=1 $(BIN)/pytest -rs
	npm test --silent -w wire/typescript
	POSECAST_FULL=1 npm test --silent -w spa
	$(BIN)/python -m fuzz
	$(BIN)/python -m tests.attack
	@# every engine is played, also after one has failed
	failed=; for engine in $(ENGINES); do POSECAST_FULL=1 POSECAST_ENGINE=$$engine $(E2E) || failed+=" $$engine"; done; \
	  test -z "$$failed" || { echo "failed in:$$failed"; exit 1; }

browsers: setup ## write the README's table of browsers, as tested on this machine
	@for package in $(E2E_NEEDS); do tools/need $$package || exit; done
	@for engine in $(ENGINES); do POSECAST_WRITE_BROWSERS=1 POSECAST_ENGINE=$$engine npm run --silent e2e -w spa -- browsers || exit; done

# ---- benchmarks ---------------------------------------------------------------

bytes: .venv/.ready ## bytes per frame and per segment on the shared telemetry sets
	$(BIN)/python wire/python/benches/bytes_per_frame.py
	$(BIN)/python -m tools.segment_bytes

bench: .venv/.ready ## the relay compared with a bare send() loop, FastAPI and websockets (needs cc; 20 to 40 minutes)
	$(BIN)/python -m relay.benches.bench

peers: setup ## the relay compared with Socket.IO, ws, Tornado, foxglove-sdk, Mosquitto and NATS (5 minutes)
	benches/peers/install
	$(BIN)/python -m benches.peers.run

lane: setup ## a robot's segments through nginx and Varnish to 5,000 viewers each (needs cc; 15 minutes, 4 with SHORT=1)
	@for package in nginx varnish; do tools/need $$package || exit; done
	$(BIN)/python -m relay.benches.lane.run $(if $(SHORT),--short) $(if $(WRITE),--write)

balance: setup ## the page's balance compared with Pinocchio (installed into out/), MuJoCo's contacts and SciPy's hull (1 minute)
	$(BIN)/pytest -srs -m full tests/test_balance_centres.py tests/test_balance_contacts.py

load: setup ## load tests: a lecture, a flash crowd, a fleet, slow phones and a hall, each against its own relay (5 minutes)
	$(BIN)/python -m posecast_loadtests
	$(BIN)/python -m posecast_loadtests.hall

gallery: .venv/.ready ## build every robot in the installed packages, or in FOLDERS="…", and draw contact sheets into gallery/
	$(BIN)/python -m tools.gallery $(FOLDERS)

pictures: setup ## the docs' pictures, captured from the page in Chromium with the demo robot (docs/img; 10 minutes)
	@tools/need chromium
	POSECAST_WRITE_PICTURES=1 $(E2E) pictures/

soak: setup ## viewers come and go for half an hour: what grows, what recovers (MINUTES=480 for a night)
	@tools/need redis-server
	@tools/need chromium
	$(BIN)/python -m posecast_loadtests.soak --minutes $(or $(MINUTES),30)

faults: setup ## break every component between robot and viewer, and check what viewers see (8 minutes)
	@tools/need redis-server
	@tools/need nftables
	$(BIN)/pytest tests/faults

attack: setup ## attack a relay while an innocent robot and viewer must notice nothing (3 minutes)
	@tools/need redis-server
	$(BIN)/python -m tests.attack $(if $(WRITE),--write)

compose-test: setup ## test infra/docker-compose.yml on a real Docker engine: build, start, check over TLS, stop
	$(BIN)/pytest -rs tests/compose

dist: setup ## wheels in dist/: posecast (everything), and wire, agent and relay alone; with their SBOMs
	rm -rf $(DIST)
	@# the relay is built from a copy with the page in it: a page left in the sources would be served by tests too
	stage=$$(mktemp -d) && trap 'rm -rf "$$stage"' EXIT && cp -r relay "$$stage" && cp -r spa/dist "$$stage/relay/src/posecast_relay/page" && \
	  for part in wire/python edge-agent "$$stage/relay" command; do $(UV) build --quiet --wheel --out-dir $(DIST) "$$part" || exit; done
	$(BIN)/python -m tools.sbom $(DIST)

bare: dist ## from an empty Debian and an empty Ubuntu to a robot on air: seconds and megabytes (root, mmdebstrap)
	@tools/need mmdebstrap
	$(BIN)/python -m tools.bare

clean: ## remove everything that was built
	rm -rf .venv .tools node_modules spa/dist dist out $(DEMO)
