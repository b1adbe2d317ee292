# Every target sets up what it needs: Python 3.12 and apt are all the machine must have.
.PHONY: setup demo test faults bench report docs view lint lock clean
PYTHON := .venv/bin/python

help:
	@echo "make demo | test | faults | bench | report | docs | view | lint | setup | lock | clean"

setup:
	@tools/setup.sh

demo: setup
	@./pam demo

test: setup
	@tools/test.sh

faults: setup
	@./pam check faults --check

bench: setup
	@$(PYTHON) benchmarks/table.py

report: setup
	@./pam gap diagnose out/demo/bag --rig config/elbow.yaml --out out/report

docs: setup
	@tools/docs.sh

view: setup
	@$(PYTHON) -c 'import rerun' 2>/dev/null || $(PYTHON) -m pip install -q -r requirements-view.txt
	@./pam bringup viewer $(BAG)

lint: setup
	@tools/lint.sh

lock: setup
	@tools/lock.sh

clean:
	rm -rf .venv .cache out build install log htmlcov .coverage*
