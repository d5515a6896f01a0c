"""Equations as MathML, which browsers draw by themselves: no script, no network, no LaTeX."""

from typing import Any
from xml.etree import ElementTree

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml

ElementTree.register_namespace("", "http://www.w3.org/1998/Math/MathML")
_M = "{http://www.w3.org/1998/Math/MathML}"


def _mathml(tex: str, block: bool = False) -> str:
    r"""MathML of LaTeX; the index of ``\hat x_k`` stands beside the letter with its accent, not below it."""
    text = tex2mathml(tex, as_block=block).replace("&ApplyFunction;", "\u2061")  # an entity of HTML, not of XML
    tree = ElementTree.fromstring(text)
    for node in tree.iter(f"{_M}munderover"):
        base, index, accent = list(node)
        if base.tag == f"{_M}mi" and accent.get("stretchy") == "false":
            node.clear()
            node.tag = f"{_M}msub"
            ElementTree.SubElement(node, f"{_M}mover", accent="true").extend([base, accent])
            node.append(index)
    return ElementTree.tostring(tree, encoding="unicode")


def _inline(writer: Any, node: nodes.math) -> None:
    writer.body.append(_mathml(node.astext()))
    raise nodes.SkipNode


def _block(writer: Any, node: nodes.math_block) -> None:
    tex = node.astext().strip()
    if r"\\" in tex and r"\begin{" not in tex:  # lines that are aligned at their ampersands
        tex = rf"\begin{{aligned}}{tex}\end{{aligned}}"
    writer.body.append(f'<div class="equation" tabindex="0">{_mathml(tex, block=True)}</div>')
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, bool]:
    """Register the renderer."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
