"""Reports: what a command found in, a page out, and the page as text, HTML, Markdown or a card of a notebook.

In: certificates as data (never the objects that made them), summaries, findings. Out: text. Trusted: no; numbers are
not computed here, they are only shown.

| module | what it does |
|---|---|
| `page` | a page as data; `text`, `html`, `markdown`, `notebook` show it, `terminal` is where text goes |
| `certificate_brief`, `certificate_page`, `sampled_loop`, `page_*` | the pages of certificates |
| `simulation`, `sampled_simulation`, `synthesis`, `verification`, `rechecked` | those of what else a command found |
| `sweep`, `comparison`, `findings` | those of several certificates, and of a check |
| `claimed`, `reach`, `gains`, `shares`, `quantities` | what they have in common: claims, sizes, gains, numbers |
| `figures_*`, `planned`, `outline` | charts: `figures_axes` says what one is, `figures_file` paints and writes it |
| `github`, `junit`, `sarif` | findings for other programs |
| `pages` | what `explain` shows |
| `progress` | what is being proven right now, on stderr |
"""
