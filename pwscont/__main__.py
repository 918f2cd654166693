"""``python -m pwscont``."""

from pwscont.interface.cli import main

raise SystemExit(main())
