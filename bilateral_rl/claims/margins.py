"""What a claim must reach: the paper's numbers, and the margins around its words.

[text]: the paper says it. [ours]: it says only "about", "almost" or "little", and we chose.
"""

UNI_DL_COMPLETION = 96.7
"""C1 (%) [text]."""

UNI_NDL_COMPLETION = 94.6
"""C1 (%) [text]."""

COMPLETION_TOLERANCE = 2.0
"""Percentage points: about the difference of 2.1 on which the paper builds C1 [ours]."""

SPEED_RATIO = (1.085, 1.255)
"""C2, uni_dl over uni_ndl: the paper's 1.17 [text] and half of its effect to both sides [ours]."""

HOLD_RATIO = (1.25, 1.75)
"""C3, uni_ndl over uni_dl: the paper's 1.5 [text] and half of its effect to both sides [ours]."""

SMALLEST_EFFECT = 0.01
"""Share of the compared means below which a difference does not matter: half of the smallest one that the paper builds
a claim on, 2.1 points of 95 (C1) [ours]."""

LITTLE = 0.10
"""Share of the performance that is "little difference" (C5) or "about as" (C8) [ours]."""

RECOVERED = 0.95
"""C8, "almost fully": at least this share of the intact network's performance [ours]."""

DROPPED = 0.80
"""C8, "a lot": at most this share of the intact network's performance [ours]."""

COMPLETES = 93.0
"""C9, "about 95 % or more" (%): 2 points below [ours], as in C1."""

NOT_WORSE = 0.95
"""Ratio above which a model is at least as good as another (C11, C13) [ours]."""

PAPER_SEEDS = 10
"""Seeds of each model [text]. With fewer, the absence of a significant difference (C10) means nothing."""
