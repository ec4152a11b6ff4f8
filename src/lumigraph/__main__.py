"""`python -m lumigraph`: the command line."""

from lumigraph.cli import main

raise SystemExit(main())
