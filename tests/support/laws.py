"""Every registered law in every one of its choices."""

from stickslip.models import plugins


def registered():
    """Each law as it is."""
    return [plugins.law(name) for name in plugins.law_names()]


def farthest(law):
    """The law with the last option of every choice."""
    return law.having(**{choice.name: list(choice.options)[-1] for choice in law.choices})


def variants():
    """Each law with every single other option, and with all last options together."""
    out = []
    for law in registered():
        for choice in law.choices:
            out += [law.having(**{choice.name: o}) for o in choice.options if o != choice.default]
        if len(law.choices) > 1:
            out.append(farthest(law))
    return out


def label(law):
    return "-".join([law.name, *law.chosen.values()])
