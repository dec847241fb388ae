"""Reports: a certificate or findings in, text for people out.

In: the certificate as data (never the objects that made it), or findings. Out: the console's text. Trusted:
no; numbers are not computed here, they are only shown.

| module | what it does |
|---|---|
| `terminal` | where text goes: colour or none, width, no trailing spaces |
| `findings` | findings as text and as data |
| `numbers`, `gains` | how numbers, and the gains of the three certificates, are shown |
| `console`, `sections` | the report of a certification |
| `synthesis`, `simulation` | the reports of synth and simulate |
| `quantities` | the numbers of a certificate as a flat list |
| `sweep`, `sweep_page`, `figures_sweep` | sweeps: table, page, curves and heat maps |
| `comparison`, `figures_comparison` | certificates side by side |
| `figures_file` | figures as files of their own |
| `figures_rates` | the metrics that a synthesis compared, drawn over the rate |
| `layout` | parts, titles and tables on a terminal |
| `page`, `page_*`, `figures_*` | a certificate as a page with figures; `html` and `markdown` show it |
| `github`, `junit`, `sarif` | findings for other programs |
| `pages` | what `explain` shows |
| `progress` | what is being proven right now, on stderr |
"""
