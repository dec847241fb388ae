"""Metric synthesis: proposals of a dual metric. Untrusted: what is proposed is proven by `tubecert.metric.verify`.

| module | what it does |
|---|---|
| `family`, `frame`, `lifting` | matrices W(x) that satisfy C3 exactly, for any B; angles as sines and cosines |
| `problem` | what a route is asked, and answers |
"""
