"""What the paper shows and what we show past it: one entry per table and figure.

A table is added by one entry and its function::

    Item(
        "smoothness",
        "Smoothness",
        "How the splines' curvature compares with the boundary's.",
        rows=(
            Comparison("smoothness", "cccd_paper.comparisons.smoothness.compare_smoothness", ("curves",)),
        ),
        table="smoothness",
    )

with ``compare_smoothness(curves)`` returning a data frame of one structure's rows (columns ``case`` and
``organ`` are added when it leaves them out). The rows of all structures, one below the other, are the table
unless ``tabulate`` names a function that makes more of them.
"""

from __future__ import annotations

from cccd.settings.surface import FILE_KEYS
from cccd_workflow.report.registry import Comparison, Input, Item

#: Keys of the section ``surface`` that no comparison reads: they are about files.
UNREAD = tuple(f"surface.{key}" for key in FILE_KEYS)

#: What a comparison's function may ask for, by the name of its parameter.
INPUTS = {
    "structure": Input(("structure.h5",), "cccd_workflow.stage_files.read_compared"),
    "boundaries": Input(("boundaries.h5",), "cccd_workflow.stage_files.read_boundaries"),
    "contours": Input(("contours.h5",), "cccd_workflow.stage_files.read_curves"),
    "curves": Input(("curves.h5",), "cccd_workflow.stage_files.read_curves"),
    "surface": Input(("surface.h5", "surface.ply"), "cccd.surface.surface.read_surface"),
    "model": Input(("gnn/model.pt",), "cccd_junctions.checkpoint.load_model", shared=True),
    "orderers": Input(
        ("gnn/model.pt",), "cccd_paper.comparisons.orderers.load_orderers", shared=True, optional=True
    ),
    "splines": Input(("curves.h5",), "cccd_workflow.stage_files.read_splines"),
    "paper_orderer": Input(
        ("workflow/models/paper.pt",), "cccd_paper.comparisons.algorithm_1.load_paper_orderer", project=True
    ),
    "segmenters": Input((), "cccd_paper.comparisons.segmenters.load_segmenters", shipped=True),
}

#: Sections of the page: title and introduction.
SECTIONS = {
    "paper": (
        "The paper",
        "What the paper shows, and the same for the structures of this run. The paper measured single slices "
        "of other data, so do not expect equal numbers.",
    ),
    "experiments": ("Further comparisons", ""),
}

CORNERS = Comparison(
    "corners",
    "cccd_paper.comparisons.corner_comparison.compare_corners",
    ("structure", "curves"),
    settings={"settings": "comparisons.corners"},
    figures="cccd_paper.comparisons.corner_comparison.corner_figures",
    columns=(
        "slice", "image", "detector", "method", "parameters", "values", "order", "corners", "on_boundary",
        "boundary_pixels", "control_points", "self_intersects", "TP rate", "FP rate", "TN rate", "FN rate",
        "ACC", "MC", "PRE", "SPEC", "DSC", "JI", "corner_ms", "curve_ms",
    ),
)  # fmt: skip

RECONSTRUCTION = Comparison(
    "reconstruction",
    "cccd_paper.comparisons.reconstruction_comparison.compare_reconstruction",
    ("structure", "curves", "orderers"),
    settings={"settings": "comparisons.corners"},
    seeded=True,
    figures="cccd_paper.comparisons.reconstruction_comparison.reconstruction_figures",
    columns=(
        "slice", "points", "n_points", "method", "given", "connected", "disconnected", "open_ends",
        "junctions", "left_out", "closed", "dice", "ms",
    ),
    memory_mb=(2500, 20),
)  # fmt: skip

ACTIVE_CONTOUR = Comparison(
    "active_contour",
    "cccd_paper.comparisons.active_contour_comparison.compare_active_contour",
    ("structure", "curves"),
    seeded=True,
    figures="cccd_paper.comparisons.active_contour_comparison.active_contour_figures",
    columns=("slice", "method", "setting", "radius", "offset", "angle", "corners", "dice", "ms"),
)

K_SWEEP = Comparison(
    "k_sweep",
    "cccd_paper.comparisons.k_sweep.compare_k",
    ("structure", "curves"),
    settings={"ks": "curves.sweep", "settings": "comparisons.corners"},
    seeded=True,
    figures="cccd_paper.comparisons.k_sweep.outline_figures",
    columns=(
        "detector", "criterion", "k", "parameters", "values", "share", "too_few", "ACC", "DSC", "JI", "ms",
        "rotation", "scale", "noise",
    ),
    minutes=15,
)  # fmt: skip

SEGMENTERS = Comparison(
    "segmenters",
    "cccd_paper.comparisons.segmenters.compare_segmenters",
    ("structure", "segmenters", "orderers"),
    settings={"edges": "boundaries", "fitting": "curves", "lofting": "surface"},
    unused=("curves.ordering", "curves.sweep", *UNREAD),
    seeded=True,
    figures="cccd_paper.comparisons.segmenters.network_figures",
    columns=("method", "given", "dice_percent"),
    memory_mb=(3000, 40),
    minutes=30,
    of="phantoms",
    further="others",
)

CORNER_SURFACES = Comparison(
    "corner_surfaces",
    "cccd_paper.comparisons.corner_surfaces.compare_corner_surfaces",
    ("structure", "boundaries", "curves", "orderers"),
    settings={"settings": "comparisons.corner_surfaces", "lofting": "surface"},
    unused=UNREAD,
    columns=(
        "k", "slices", "control_points", "share", "dice_2d", "dice_3d", "assd_mm", "stack_bytes",
        "image_bytes", "net_bytes", "seconds",
    ),
    memory_mb=(3000, 60),
    minutes=30,
    further="all",
)  # fmt: skip

STAGE_TIMES = Comparison(
    "stage_times",
    "cccd_paper.comparisons.stage_times.time_stages",
    ("structure", "curves", "orderers"),
    settings={
        "finding": "boundaries",
        "lofting": "surface",
    },
    unused=UNREAD,
    columns=(
        "method", "slices", "corner_ms", "curve_ms", "spline_ms", "surface_ms", "total_ms", "closed_share",
        "dice_3d",
    ),
    memory_mb=(3000, 60),
    minutes=30,
    further="all",
)  # fmt: skip

ISOSURFACES = Comparison(
    "isosurfaces",
    "cccd_paper.comparisons.isosurfaces.compare_isosurfaces",
    ("structure", "curves", "surface"),
    settings={"settings": "comparisons.isosurfaces", "lofting": "surface"},
    unused=UNREAD,
    columns=("method", "seconds"),
    memory_mb=(3000, 60),
    minutes=30,
    further="others",
)

THICK_SLICES = Comparison(
    "thick_slices",
    "cccd_paper.comparisons.thick_slices.thick_slice_experiment",
    ("structure",),
    settings={"settings": "comparisons.thick_slices", "lofting": "surface"},
    unused=UNREAD,
    columns=("slice_distance_mm", "every_nth", "method", "seconds"),
    memory_mb=(3000, 60),
    minutes=30,
    further="all",
)

ORDERING = Comparison(
    "ordering",
    "cccd_paper.comparisons.ordering_comparison.compare_ordering",
    ("structure", "boundaries", "contours", "model"),
    columns=(
        "pixels", "junctions", "isolated_corners", "kept", "dropped", "bridged", "slices", "decided",
        "curves", "curves_exact", "dice", "dice_decided",
    ),
    memory_mb=(2500, 20),
    minutes=15,
    of="traced masks",
)  # fmt: skip

MAP_SURFACES = Comparison(
    "map_surfaces",
    "cccd_paper.comparisons.map_surfaces.compare_map_surfaces",
    ("structure", "boundaries", "contours", "surface"),
    settings={"lofting": "surface"},
    unused=UNREAD,
    figures="cccd_paper.comparisons.map_surfaces.map_figures",
    columns=(
        "method", "slices", "decided", "without_curve", "pixels", "kept", "dropped", "bridged", "curves",
        "dice_3d", "assd_mm", "hd95_mm", "volume_bias",
    ),
    memory_mb=(2500, 40),
    of="maps",
)  # fmt: skip

ALGORITHM_1 = Comparison(
    "algorithm_1",
    "cccd_paper.comparisons.algorithm_1.compare_algorithm_1",
    ("structure", "boundaries", "curves", "splines", "surface", "paper_orderer"),
    figures="cccd_paper.comparisons.algorithm_1.section_figures",
    columns=("method", "slices", "closed"),
    memory_mb=(3000, 40),
    of="structures",
)

_TABLES, _PLOTS = "cccd_paper.comparisons.paper_tables.", "cccd_paper.figures.items."

_JUNCTIONS = (
    "decoder", "kind", "maps", "correct", "dice", "hausdorff_px", "ms", "link_f1", "isolated_corners",
    "dropped", "bridged",
)  # fmt: skip

#: Of items whose comparison is `Comparison.further` for ``others``.
_FIRST_ONLY = "The default run has the first phantom, whose truth is known; `snakemake evidence` all."

ITEMS = (
    Item(
        "figure5",
        "The network that corrects chain codes",
        "Equation (11) in a picture: dense layer, batch normalisation, dropout 0.5, an activation, a sum "
        "over the neighbours; links are predicted. Its depth and width are not printed: here they are those "
        "of Spektral's GeneralGNN, with 64 channels.",
        name="Figure 5",
        section="paper",
        plots=_PLOTS + "figure_5",
        captions=(
            "The paper's network as printed (gnn.network: paper); from the dense layer to the sum, layer "
            "after layer. Ours reads a Delaunay graph instead and decides by a minimum cut.",
        ),
    ),
    Item(
        "figure6",
        "Raw images",
        "One slice each of LiTS17, RIDER Lung PET-CT and UPENN-GBM.",
        name="Figure 6",
        section="paper",
        rows=(CORNERS,),
        plots=_PLOTS + "figure_6",
        captions=(
            "The middle slice as it came (the mask where there is no image), and its longest outline.",
        ),
    ),
    Item(
        "figure7",
        "Training data",
        "Boundary maps of the three datasets, 290 graphs.",
        name="Figure 7",
        section="paper",
        plots=_PLOTS + "figure_7",
        captions=("The first training graphs: pixels (dots) over their true contour (band).",),
        network=True,
    ),
    Item(
        "figure8",
        "The whole method",
        "Algorithm 1 as a block diagram.",
        name="Figure 8",
        section="paper",
        plots=_PLOTS + "figure_8",
        captions=(
            "Algorithm 1 with its lines. Here a mask is traced without a network, and the surface is "
            "made from the contours, not from their splines.",
        ),
    ),
    Item(
        "table1",
        "Corners that miss the boundary",
        "On one liver slice Harris finds 716 corners, 232 of them on the boundary (67.5 % false); "
        "Shi-Tomasi 53 and 11 (79.24 %); FAST 212, all on it. The paper does not say which image of the "
        "slice they read: here they read the filled mask, the outline that line 10 of Algorithm 1 leaves, "
        "and the grey slice. (716 corners of which 232 lie on the boundary are 67.6 % false; section 6.1 "
        "counts 101 Harris corners on the boundary.)",
        name="Table 1",
        section="paper",
        rows=(CORNERS,),
        table="table1_corners",
        columns=("organ", "image", "method", "parameters", "corners", "on_boundary", "false_percent"),
        tabulate=_TABLES + "table_1",
    ),
    Item(
        "figure9",
        "Corner detectors fused with a B-spline",
        "FUSE1 (Harris) reaches a Dice score of 87.54 % and crosses itself, FUSE2 (Shi-Tomasi) 79.75 %, "
        "FUSE3 (FAST) 93.15 %.",
        name="Figure 9",
        section="paper",
        rows=(CORNERS,),
        plots=_PLOTS + "figure_9",
        captions=(
            "Boundary (thin), corners (dots) and fused splines (thick): above with the paper's parameters, "
            "below with the best of the grid; corners ordered by a short tour.",
        ),
    ),
    Item(
        "table2",
        "CCCD against the fused detectors",
        "FUSE1 95.4 % with 232 points, FUSE2 73 % with 11, FUSE3 88.4 % with 212; CCCD 96.00 % with 102 "
        "(k = 7) and 98.49 % with 156 (k = 3). Section 6.1 has other scores for the same fused methods: "
        "87.54, 79.75 and 93.15 %.",
        name="Table 2",
        section="paper",
        rows=(CORNERS,),
        table="table2_fuse",
        columns=("organ", "image", "method", "parameters", "order", "dice_percent", "control_points"),
        tabulate=_TABLES + "table_2",
    ),
    Item(
        "figure10",
        "CCCD for four values of k",
        "Dice is 98.49 % with 156 points (k = 3), 95.83 % with 121 (k = 5), 96.00 % with 102 (k = 7) and "
        "88.75 % with 67 (k = 20). The caption has 105 points for k = 5.",
        name="Figure 10",
        section="paper",
        rows=(K_SWEEP,),
        plots=_PLOTS + "figure_10",
        captions=(
            "Boundary (band), corners (dots), spline (line); maxima of curvature.",
            "Dice of the paper's own splines and the share of boundary pixels they keep, against k; "
            "corners at maxima of curvature, medians over slices.",
        ),
    ),
    Item(
        "figure11",
        "Ten rates of CCCD and the fused detectors",
        "CCCD at k = 3 has the highest true positive rate and the lowest misclassification; its rates of "
        "false positives and false negatives are 0.0029 and 0.00348.",
        name="Figure 11",
        section="paper",
        rows=(CORNERS,),
        table="figure11_rates",
        columns=("organ", "image", "method", "parameters", "control_points", "ACC", "MC", "DSC", "JI"),
        tabulate=_TABLES + "figure_11",
        plots=_PLOTS + "figure_11",
        captions=(
            "Equations 12-21, medians over slices and structures; detectors with the paper's parameters, "
            "those of Table 2 and those of Figure 9, on the organ's mask, their corners along a short tour.",
        ),
    ),
    Item(
        "figure12",
        "One k, two organs",
        "At k = 20 a brain boundary keeps 98.27 % Dice, a liver boundary 87.29 %.",
        name="Figure 12",
        section="paper",
        rows=(K_SWEEP,),
        plots=_PLOTS + "figure_12",
        captions=(
            "The middle slice of every structure at k = 20, maxima of curvature.",
            "The same k = 20 on every structure, for both criteria.",
        ),
    ),
    Item(
        "figure13",
        "Accuracy, Dice and Jaccard against k",
        "The text says that all three fall as k grows, with minima of curvature as corners suddenly near k "
        "= 20, and that maxima cure it. At k = 3 Dice is 0.9849 on a liver and 0.9842 on a brain.",
        name="Figure 13",
        section="paper",
        rows=(K_SWEEP,),
        plots=_PLOTS + "figure_13",
        captions=("Accuracy, Dice and Jaccard against k, per structure and criterion; medians over slices.",),
    ),
    Item(
        "table3",
        "CCCD against segmentation networks",
        "Polar U-Net 93.02 %, KiU-Net 3D 94.23 %, H-DenseUNet 96.5 % Dice from 483 boundary pixels (19.2 "
        "KB); CCCD 98.49 % from 189 (1.47 KB), 96.00 % from 217, 96.37 % from 133 (1.03 KB). 483 pixels at "
        "the paper's 8 bytes a point are 3.8 KB: the saving compares points with an image.",
        name="Table 3",
        section="paper",
        rows=(CORNERS,),
        table="table3_segmentation",
        columns=("organ", "method", "parameters", "boundary_pixels_used", "dice_percent", "note"),
        tabulate=_TABLES + "table_3",
    ),
    Item(
        "segmenters",
        "Table 3, measured here",
        "The paper compares the networks' Dice on other data (93.02, 94.23 and 96.5 %) with CCCD's on the "
        "true boundary (98.49, 96.00 and 96.37 %). Here all use the same scans. The networks find the organ "
        "in the grey image. CCCD describes the true mask, each network's mask, and what the junction network "
        "finds in the image around a seed, a voxel in the middle of each part. The networks have 0.24 to 1.4 "
        "million parameters, fewer than published, and are trained on phantoms of the generator that made "
        "these scans, so their Dice does not hold for real scans. The paper's figures are of CT livers, and "
        "are shown only for livers. " + _FIRST_ONLY,
        name="Table 3",
        section="paper",
        rows=(SEGMENTERS,),
        table="segmenters",
        columns=("case", "organ", "method", "given", "dice_percent", "assd_mm", "paper_dice_percent"),
        tabulate=_TABLES + "segmenters",
    ),
    Item(
        "figure14",
        "CCCD's outline for k = 3, 7 and 12",
        "Outlines from 189, 217 and 133 boundary pixels, (a) to (c), and H-DenseUNet's, 483 pixels, (d).",
        name="Figure 14",
        section="paper",
        rows=(K_SWEEP,),
        plots=_PLOTS + "figure_14",
        captions=(
            "Boundary (band), corners (dots), spline (line); maxima of curvature. Of H-DenseUNet, where it "
            "is shipped for the organ, the line is the border of what it finds in the grey image.",
        ),
    ),
    Item(
        "figure15",
        "An active contour from a seed",
        "The B-spline snake of Marsousi et al. depends on the seed's radius and place; its best of five "
        "runs reaches 79.78 % Dice, and on a lung it leaves a large part outside.",
        name="Figure 15",
        section="paper",
        rows=(ACTIVE_CONTOUR,),
        table="figure15_snakes",
        columns=("organ", "method", "setting", "radius", "offset", "dice_percent"),
        tabulate=_TABLES + "figure_15",
        plots=_PLOTS + "figure_15",
        captions=(
            "Boundary (thin), seed (dashed), corners (dots) and the snake's end (thick), for five seeds of "
            "our choice: the paper prints neither their radius nor their place.",
            "Dice against the seed's radius and its distance from the centroid, both in radii of the disc "
            "that has the organ's area; medians over slices and structures.",
        ),
    ),
    Item(
        "figure16",
        "Curves reconstructed from corner points",
        "From Harris corners Connect2D, Crawl and NN-Crust leave gaps; CCCD closes the curve. CCCD is shown "
        "with the order given and with the order found, as in Table 4.",
        name="Figure 16",
        section="paper",
        rows=(RECONSTRUCTION,),
        plots=_PLOTS + "figure_16",
        captions=(
            "Harris corners on the boundary (dots) and the links that each method makes.",
            "How often each method links the points of a slice into one closed curve, and the Dice of what "
            "its links enclose; all slices and structures together.",
        ),
    ),
    Item(
        "table4",
        "Connected and disconnected segments",
        "Connect2D leaves 2 segments, Crawl 4, NN-Crust 12; CCCD one closed curve. CCCD has a row with the "
        "order given, by the true chain code, and rows with the order found: from the boundary's pixels, "
        "and from the points alone, which is all that the others see. The rank is among these.",
        name="Table 4",
        section="paper",
        rows=(RECONSTRUCTION,),
        table="table4_reconstruction",
        columns=("organ", "points", "method", "given", "connected", "closed_percent", "dice_percent", "rank"),
        tabulate=_TABLES + "table_4",
    ),
    Item(
        "table5",
        "Time to find corners and to connect them",
        "Corners: Harris 1.885 s, Shi-Tomasi 1.304 s, FAST 0.93 s, CCCD 2.889 s. Curves: Connect2D 3.44 "
        "s, Crawl 6.87 s, NN-Crust 5.34 s, CCCD 0.395 s.",
        name="Table 5",
        section="paper",
        rows=(CORNERS, RECONSTRUCTION),
        table="table5_times",
        columns=("organ", "method", "parameters", "corner_ms", "curve_ms"),
        tabulate=_TABLES + "table_5",
        plots=_PLOTS + "table_5",
        captions=("Processor time per slice, medians, on a logarithmic axis.",),
    ),
    Item(
        "stage_times",
        "Table 5, from the image to the surface",
        "The paper measures corners and curves separately, and a surface once (4.287 s). Here every method "
        "goes the whole way on the same slices, whose longest curves are filled: corners of the mask's "
        "image (those near the boundary, which it must know), one closed curve, spline, surface. CCCD first "
        "finds and orders boundary pixels (counted as time of its curve), and takes corners at k = 3. Slices "
        "without one closed simple curve are left out. The splines of every method go through pixel centres "
        "and are lofted there, half a pixel inside the mask. Processor time per slice.",
        section="paper",
        rows=(STAGE_TIMES,),
        table="stage_times",
        columns=("case", "organ", *STAGE_TIMES.columns),
    ),
    Item(
        "figure17",
        "The surface",
        "Marching cubes leaves a grid-like roughness on a liver (a); the stacked splines do not (b); "
        "their control net encloses the surface (c). It took 4.287 s.",
        name="Figure 17",
        section="paper",
        rows=(ISOSURFACES,),
        plots=_PLOTS + "figure_17",
        captions=("from the front, flat-shaded.",),
    ),
    Item(
        "algorithm_1",
        "Algorithm 1, line by line, and ours",
        "The whole printed chain next to ours, on every structure that is compared: boundary pixels of the "
        "mask, or edges of the image within the region that ours starts from; chain codes; the paper's "
        "network (shipped) where a pixel has more than two neighbours; corners at k = 3; splines with the "
        "corners as control points; the surface of eq. (10), one tube with planes at its ends. "
        "A slice whose chain does not close has no curve. The Dice of the curves is the median over the "
        "mask's slices. Surfaces are compared with the true surface of a phantom, and otherwise with the "
        "mask.",
        name="Algorithm 1",
        section="paper",
        rows=(ALGORITHM_1,),
        table="algorithm_1",
        columns=("case", "organ", *ALGORITHM_1.columns),
        plots=_PLOTS + "algorithm_1",
        captions=("a cut across the slices: the surface (line) and the reference (band).",),
    ),
    Item(
        "corner_surfaces",
        "From corners to the surface",
        "The paper's chain to its end, for the k of Table 3: the corners are the control points, and the "
        "surface is lofted from their splines. A row has the automatic splines. Lofting also gets the number "
        "of pixels within each curve (4 bytes, counted), and moves a spline outwards until it encloses as "
        "many. The paper keeps 39.13 % of the boundary's pixels at k = 3 "
        "(92.34 % less memory than an image of 19.2 KB) and 72.46 % fewer at k = 12, and counts 160 KB for "
        "200 slices against 64 MB.",
        section="paper",
        rows=(CORNER_SURFACES,),
        table="corner_surfaces",
        columns=("case", "organ", *CORNER_SURFACES.columns),
        tabulate=_TABLES + "corner_surfaces",
    ),
    Item(
        "shapes",
        "Shapes such as 'A', 'H' and 'X'",
        "Section 9 leaves them to future study: intersecting splines that replicate organs of complex shapes "
        "such as these characters. Here is every surface whose truth is known, with its genus, counted on "
        "the closed mesh, and its volume, next to the true ones.",
        name="Section 9",
        section="paper",
        table="shapes",
        columns=("case", "organ", "slices", "genus", "genus_true", "volume_bias"),
        tabulate="cccd_paper.comparisons.cohort_tables.shapes",
    ),
    Item(
        "surfaces",
        "Against the baselines' surfaces",
        "Every method on the same structures, measured alike. Baselines with windowed-sinc smoothing are "
        "tried with pass bands 0.1, 0.05 and 0.01 and 20 or 60 rounds (3D Slicer's default factor 0.5 is "
        "pass band 0.01). They are shown at their smallest ASSD, and at the smallest among settings that "
        "bend at most 1.05 times as much as ours. “CCCD, distances alone” is the isosurface of the distances "
        "that our surface is made of, before filter and spline, smoothed in the same way. Programs "
        "(niimath, 3D Slicer's own converters) also have a row at their defaults, and none if they are not "
        "installed. Processor seconds count from the mask; ours is made once more to be timed. Genus counts "
        "handles, next to the true surface's if it is known. " + _FIRST_ONLY,
        rows=(ISOSURFACES,),
        table="surfaces",
        columns=("case", "organ", "method", "seconds"),
        plots=_PLOTS + "surfaces",
        captions=(
            "Each dot is a structure. Bytes are those of the mesh; for ours, those of the stored control "
            "mesh.",
        ),
    ),
    Item(
        "thick_slices",
        "Thick slices",
        "Every n-th slice is kept, and the surface of these is compared with the full resolution. Baselines "
        "have the settings that suit them best, as above.",
        rows=(THICK_SLICES,),
        table="thick_slices",
        columns=("case", "organ", "slice_distance_mm", "method", "seconds"),
        plots=_PLOTS + "thick_slices",
        captions=(
            "rebuilt from every n-th slice, measured at full resolution; baselines at their smallest ASSD.",
        ),
    ),
    Item(
        "junctions",
        "Junction repair",
        "Boundary maps with spurs, bridges, gaps and noise, ordered by our network, the paper's and the "
        "classical decoders. The paper prints its network's graph, features, convolution, dropout and "
        "labels. Its design and depth are those of Spektral's GeneralGNN, its 64 channels and its learning "
        "rate the best of a sweep (docs/measured/paper_network.csv); epochs, batch, optimiser, loss, and how "
        "two pixels give a link's value are invented here. Its chains bridge no gaps: one that stays open is "
        "dropped. The shipped one was trained on a run's 200 graphs in each of eight epochs "
        "(docs/equal_maps.csv has it on 1,500). Ours sees new maps, thousands in a run and 391,000 for the "
        "shipped weights. The generator of the training also damaged the maps of this table, so all of it is "
        "in distribution. Dropped are pixels of a map that lie on no curve; bridged are pixels of the curves "
        "that are not in the map.",
        table="junctions",
        columns=_JUNCTIONS,
        plots=_PLOTS + "junctions",
        captions=("Share of slices whose curve is right, and mean Dice, per kind of corruption.",),
        network=True,
    ),
    Item(
        "map_surfaces",
        "Surfaces from boundary maps",
        "Structures that come without a mask: their boundary pixels are edges of an image or a damaged map, "
        "and the network orders them. A second row is the surface by the classical decoder of the table "
        "above that is nearest to the reference, from the map's pixels alone. (The network also reads the "
        "image, if there is one, and the neighbouring slices.) For an image, further rows are the region in "
        "which edges are sought, and the threshold that is nearest to the reference. Of all these the "
        "filtered mesh is measured: a spline would lie within hundredths of a pixel of it. Maps of a phantom "
        "have the damage of the network's training, so such a row is in distribution.",
        rows=(MAP_SURFACES,),
        table="map_surfaces",
        columns=("case", "organ", *MAP_SURFACES.columns),
        plots=_PLOTS + "map_surfaces",
        captions=(
            "links of the boundary map that are kept (thick) and dropped (thin), and links that bridge its "
            "gaps (dark), on slices that are no outlines already.",
        ),
    ),
    Item(
        "ordering",
        "Isolated corners, and what became of the pixels",
        "Where a greedy chain code gets stuck on the boundary pixels (Figure 4): how many of these pixels "
        "the ordered curves keep and drop, and how many pixels bridge gaps. For a mask that was traced, the "
        "row shows what the network would have made of its pixels, on the slices that are not outlines "
        "already. The network decides only on those.",
        rows=(ORDERING,),
        table="ordering",
        columns=("case", "organ"),
        tabulate="cccd_paper.comparisons.cohort_tables.ordering",
    ),
    Item(
        "compactness",
        "Compactness",
        "Bytes per slice of the splines (control points, knots, header), the chain code, the PNG and the raw "
        "contour.",
        table="compactness",
        columns=("case", "organ", "spline", "spline_16_bit", "chain_code", "raw", "png"),
        tabulate="cccd_paper.comparisons.cohort_tables.compactness",
        plots=_PLOTS + "compactness",
        captions=("The paper counts 19.2 KB for an image and 1.03 KB for its corners.",),
    ),
    Item(
        "k_sweep",
        "Corners on the chain code: the whole sweep",
        "For every structure: the k-cosine for every k and both criteria, and the five chain-code detectors "
        "that section 2 names but the paper does not run, with their defaults here and with "
        "the best of a grid on training phantoms. Shown are splines through their corners, and the share of "
        "corners that are found again within 3 pixels if the outlines of some slices are turned, scaled, or "
        "disturbed. Of dense corners, some are found again by chance.",
        rows=(K_SWEEP,),
        table="k_sweep",
        columns=("case", "organ", *K_SWEEP.columns),
    ),
)
