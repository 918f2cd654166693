"""What tests of pictures share."""

from matplotlib.collections import LineCollection
from matplotlib.patches import StepPatch


def steps(ax):
    """Return the step lines by their labels: values and edges."""
    patches = [patch for patch in ax.patches if isinstance(patch, StepPatch)]
    return {patch.get_label(): patch.get_data() for patch in patches}


def lines(ax):
    """Return the points of all lines of branches."""
    return [line for some in collections(ax) for line in some.get_segments()]


def collections(ax):
    return [some for some in ax.collections if isinstance(some, LineCollection)]


def legend_words(legend):
    return [text.get_text() for text in legend.get_texts()]


def words_of(figure):
    """Return the words of all legends of a figure."""
    legends = [*figure.legends, *(ax.get_legend() for ax in figure.axes)]
    return [word for legend in legends if legend for word in legend_words(legend)]
