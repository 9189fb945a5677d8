"""Where the paper contradicts itself, by the items of the report."""

from __future__ import annotations

__all__ = ["CONTRADICTIONS"]

#: Where the printed figures contradict each other, by the table or figure that shows them.
CONTRADICTIONS = {
    "table1": "716 corners of which 232 lie on the boundary are 67.6 % false, not 67.5 %; section 6.1 "
    "counts 101 Harris corners on the boundary where Table 1 has 232.",
    "table2": "the same fused methods score 87.54, 79.75 and 93.15 % in section 6.1 and 95.4, 73 and 88.4 % "
    "in Table 2, the last two with the same number of points.",
    "table3": "k = 7 uses more points (217) than k = 3 (189), while Figure 10 has 102 against 156, and "
    "k = 12 scores higher than k = 7, while Figure 13 has Dice falling with k. 483 boundary pixels at the "
    "paper's 8 bytes a point are 3.8 KB, not 19.2 KB: the saving compares points with an image. nnU-Net's "
    "88.95 % is for tumours, not for the whole brain.",
    "figure10": "for k = 5 the text has 121 points, the caption 105.",
    "training": "40 validation graphs of 290 are 14 %, not 5 %.",
}
