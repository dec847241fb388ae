"""The C and the Python that `export` writes, read, run on balls, and followed: what their rounding can lose.

Both become the same program. Nothing is shared with the exporter but the text: a closed grammar, of which everything
else is refused.
"""
