"""Reports: a certificate or findings in, text for people out.

In: the certificate as data (never the objects that made it), or findings. Out: the console's text. Trusted:
no; numbers are not computed here, they are only shown.

| module | what it does |
|---|---|
| `terminal` | where text goes: colour or none, width, no trailing spaces |
| `findings` | findings as text and as data |
| `numbers`, `gains` | how numbers, and the gains of the three certificates, are shown |
| `console`, `sections` | the report of a certification |
| `progress` | what is being proven right now, on stderr |
"""
