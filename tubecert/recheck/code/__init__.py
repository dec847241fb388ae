"""The C that `export` writes, read, run on balls, and followed operation by operation: what its rounding can lose.

Nothing is shared with the exporter but the text: a closed grammar, of which everything else is refused.
"""
