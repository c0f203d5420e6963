# One command each; every target does all set-up first (and none when it is done already).
#   make run ARGS="terrain --size 256 256"      make test ARGS="-k footprint"
#   make extras EXTRA=notebooks
ARGS ?=
BIN := .venv/bin

.DEFAULT_GOAL := run
.PHONY: setup extras run test test-hard lint types bench docs lock

setup:
	@scripts/setup

# What pyproject.toml calls an extra, into the same environment.
extras: setup
	@scripts/setup --extra $(or $(EXTRA),$(error which? make extras EXTRA=analysis, notebooks, cuda12 or cuda13))

run: setup
	@$(BIN)/asmjax run $(ARGS)

test: setup
	@$(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder -q $(ARGS)

# Ten times as much of what chance finds, in parts, and a table of what each took; some of them:
#   make test-hard ARGS="hard_cases hostile"
test-hard: setup
	@$(BIN)/python scripts/test_hard.py $(ARGS)

lint: setup
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .

types: setup
	@$(BIN)/pyright $(ARGS)

bench: setup
	@$(BIN)/python -m pytest --benchmark-only --benchmark-warmup=on -q $(ARGS)

# Into build/site; a broken link or reference fails it.
docs: setup
	@scripts/setup --group docs
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

# A requirements file names versions only; uv.lock would name the registry of whoever made it.
lock: setup
	@$(BIN)/uv pip compile pyproject.toml --universal --no-header --no-annotate \
	    --group test --group dev --system-certs -q -o requirements.lock
