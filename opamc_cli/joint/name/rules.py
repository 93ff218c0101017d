"""The rules beside the search itself: what each prevents and costs stands in docs/loop.md."""

RULES = {
    "beam": "two chains instead of one",
    "share": "an effect takes 5 % of the held-out error",
    "certain": "a function without a name takes twice its standard error over parts of the data",
    "sign": "coefficients have the sign that physics gives them",
    "drift": "a change in time is seen beside free offsets, or explains as much as they do",
    "smoothing": "a wind-up or a delay is seen beside what other windows make of the motion",
    "unnamed": "an effect gives way to an unnamed function that explains the data clearly better",
    "windows": "the motion is differentiated over the window that predicts best",
}
