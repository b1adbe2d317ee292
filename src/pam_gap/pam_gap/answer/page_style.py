"""The look that all pages share: on a desk, on a phone, on paper, in light and dark."""

from __future__ import annotations

from typing import Any, Final

PLOT_LOOK: Final[dict[str, Any]] = {
    "font.size": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#9aa3b2",
    "axes.grid": True,
    "grid.color": "#eceef2",
    "legend.frameon": False,
}
"""The same for plots by matplotlib, as its rcParams."""

STYLE = """
 :root { color-scheme: light dark; --ink: #1c1c1c; --quiet: #555; --paper: #fff; --box: #f4f4f4;
         --line: #ccc; --edge: #8886; --good: #1a7f4b; --bad: #b3261e; }
 @media (prefers-color-scheme: dark) {
  :root { --ink: #eee; --quiet: #b5b5b5; --paper: #16181b; --box: #24272b; --line: #4a4f55;
          --edge: #aaa6; --good: #5fd394; --bad: #ff8f86; } }
 body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem;
        color: var(--ink); background: var(--paper); overflow-wrap: anywhere; }
 .verdict { border-left: .5rem solid var(--verdict, #6b7280); background: var(--box);
            padding: 1rem 1.2rem; font-size: 1.25rem; }
 .verdict b { display: block; font-size: .95rem; letter-spacing: .03em; }
 .verdict small { display: block; font-size: .95rem; color: var(--quiet); margin-top: .4rem; }
 h1 { font-size: 1.5rem; margin: 0 0 .6rem; }
 h2 { margin-top: 2.2rem; border-bottom: 1px solid var(--line); }
 figure { margin: 1rem 0; } figcaption { color: var(--quiet); font-size: .92rem; }
 summary { cursor: pointer; margin: .4rem 0; }
 .wide { overflow-x: auto;
         background: linear-gradient(to left, transparent, var(--paper) 2rem) left,
         linear-gradient(to right, transparent, var(--paper) 2rem) right,
         linear-gradient(to right, var(--edge), transparent) left,
         linear-gradient(to left, var(--edge), transparent) right;
         background-repeat: no-repeat;
         background-size: 3rem 100%, 3rem 100%, .8rem 100%, .8rem 100%;
         background-attachment: local, local, scroll, scroll; }
 table { border-collapse: collapse; font-size: .92rem; } td, th { padding: .2rem .8rem .2rem 0;
 text-align: left; vertical-align: top; overflow-wrap: normal; }
 .n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
 img { display: block; width: 100%; height: auto; background: #fff; border-radius: .3rem; }
 .plot { margin: 1rem 0; background: #fff; color: #1c1c1c; border-radius: .3rem; padding: .3rem; }
 .plot b { display: block; padding: .3rem .6rem; font-size: .95rem; overflow-wrap: anywhere; }
 .plot figcaption { color: #555; padding: 0 .6rem .3rem; font-size: .92rem; }
 .bars { width: 100%; } .bars td { white-space: normal; }
 .bar { width: 45%; } .bar span { display: block; height: .8rem; margin-top: .35rem;
        print-color-adjust: exact; background: #00798c; border-radius: .15rem; min-width: 1px; }
 .origin td { overflow-wrap: anywhere; }
 code { background: var(--box); padding: 0 .25rem; }
 .quiet { color: var(--quiet); } .good { color: var(--good); } .bad { color: var(--bad); }
 @media (max-width: 40rem) { body { margin: .6rem auto; padding: 0 .7rem; }
  table { font-size: .78rem; } td, th { padding-right: .5rem; }
  td:first-child { min-width: 5.5rem; }
  td:last-child:not(.n, .bar, :empty) { min-width: 11rem; } th.n { white-space: normal; }
  h1 { font-size: 1.2rem; margin-bottom: .4rem; }
  .verdict { padding: .6rem .8rem; font-size: 1.1rem; }
  .plot { margin: .6rem 0; } }
 @media print { body { margin: 0; } h2 { break-after: avoid; } }
"""
"""Style sheet; `--verdict` is the colour of the bar next to the first sentence.

What is wider than the page scrolls, and is shaded where it goes on.
"""

VERDICT_COLOURS = {
    "named": "#00798c",
    "ambiguous": "#b7791f",
    "unknown": "#c2410c",
    "none": "#2f855a",
    "not_identifiable": "#6b7280",
}
VERDICT_WORDS = {
    "named": "Cause found",
    "ambiguous": "Several causes possible",
    "unknown": "Cause unknown",
    "none": "No cause needed",
    "not_identifiable": "Not enough in the recording",
}
