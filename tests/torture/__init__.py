"""Fault injection: `python -m tests.torture` kills, damages and starves; what survives?"""
