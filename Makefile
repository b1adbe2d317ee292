# Every target sets up what it needs: Python 3.12 and apt are all the machine must have.
.PHONY: setup demo test test-all faults bench report docs view lint lock release clean
# not named PYTHON: tools/setup.sh reads that from the environment
IN_VENV := .venv/bin/python

help:
	@echo "make demo | test | test-all | faults | bench | report | docs | view | lint | setup | lock | release | clean"

setup:
	@tools/setup.sh

demo: setup
	@./pam demo

test: setup
	@tools/test.sh

test-all: setup
	@tools/test.sh all

faults: setup
	@./pam check faults --check

bench: setup
	@$(IN_VENV) benchmarks/table.py

report: setup
	@./pam gap diagnose out/demo/bag --rig config/elbow.yaml --out out/report

docs: setup
	@tools/docs.sh

view: setup
	@$(IN_VENV) -c 'import rerun' 2>/dev/null || $(IN_VENV) -m pip install -q -r requirements-view.txt
	@./pam bringup viewer $(BAG)

lint: setup
	@tools/lint.sh

lock: setup
	@tools/lock.sh

# VERSION=0.3.0 prepares the files of a release; TAG=1 makes the tag of one that is built and checked
release: setup
	@tools/release.sh $(if $(VERSION),prepare $(VERSION),$(if $(TAG),tag))

clean:
	rm -rf .venv .cache out build install log htmlcov .coverage*
