"""3D Slicer's module "CCCD surface": a segment becomes a smooth closed model."""

from __future__ import annotations

import shlex

import ctk  # pyright: ignore[reportMissingImports]
import qt  # pyright: ignore[reportMissingImports]
import slicer  # pyright: ignore[reportMissingImports]
from CCCDSurfaceLib.logic import CccdError, make_model  # pyright: ignore[reportMissingImports]
from slicer.ScriptedLoadableModule import (  # pyright: ignore[reportMissingImports]
    ScriptedLoadableModule,
    ScriptedLoadableModuleWidget,
)

#: The setting in which Slicer keeps how `cccd` is called.
COMMAND = "CCCDSurface/Command"


class CCCDSurface(ScriptedLoadableModule):
    """What Slicer shows of the module."""

    def __init__(self, parent):
        super().__init__(parent)
        parent.title = "CCCD surface"
        parent.categories = ["Surface Models"]
        parent.contributors = ["The CCCD developers"]
        parent.helpText = (
            "Makes a smooth closed surface of a segment, also where slices are thick or only some are drawn. "
            "The program cccd must be installed in a Python of its own."
        )


class CCCDSurfaceWidget(ScriptedLoadableModuleWidget):
    """Choose a segment, how `cccd` is called, and which slices are drawn."""

    def setup(self):
        """Lay the fields out."""
        super().setup()
        box = ctk.ctkCollapsibleButton()
        box.text = "Smooth surface"
        self.layout.addWidget(box)
        form = qt.QFormLayout(box)
        self.segment = slicer.qMRMLSegmentSelectorWidget()
        self.segment.setMRMLScene(slicer.mrmlScene)
        form.addRow("Segment", self.segment)
        self.annotated = qt.QComboBox()
        self.annotated.addItems(["auto", "nonempty", "every slice"])
        form.addRow("Annotated slices", self.annotated)
        self.command = qt.QLineEdit(slicer.app.settings().value(COMMAND, "cccd"))
        form.addRow("cccd", self.command)
        self.button = qt.QPushButton("Make the surface")
        self.button.connect("clicked(bool)", self.make)
        form.addRow(self.button)
        self.layout.addStretch(1)

    def make(self):
        """Make the surface; what is wrong is one line in a window."""
        slicer.app.settings().setValue(COMMAND, self.command.text)
        node, segment = self.segment.currentNode(), self.segment.currentSegmentID()
        if node is None or not segment:
            slicer.util.errorDisplay("choose a segment")
            return
        with slicer.util.WaitCursor():
            try:
                model, warnings = make_model(
                    slicer.mrmlScene,
                    node,
                    segment,
                    shlex.split(self.command.text),
                    self.annotated.currentText,
                    slicer.util.startupEnvironment(),
                )
            except CccdError as error:
                slicer.util.errorDisplay(str(error))
                return
        model.CreateDefaultDisplayNodes()
        colour = node.GetSegmentation().GetSegment(segment).GetColor()
        model.GetDisplayNode().SetColor(*colour)
        if warnings:
            slicer.util.warningDisplay("\n".join(warnings))
