"""The paper's tables and figures: which states they need, how they are drawn, what they show."""
