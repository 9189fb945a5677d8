"""What everything else speaks: meshes, ragged polygons, grids, B-splines, and what is measured on them.

One of each. Nothing here knows an organ, a slice stack or a file of the pipeline; lengths are in the unit
of the coordinates, mostly mm.

=================  =================================================================================
module             holds
=================  =================================================================================
``arrays``         types of arrays; ragged arrays: offsets, owners, neighbours on closed parts
``mesh``           `Mesh`: volume, area, normals, dihedral angles, soundness, samples
``conforming``     `ConformingSurface`: several regions whose walls are one surface each
``collisions``     pairs of triangles that pass through each other
``ply``            meshes to and from PLY files, in double precision
``polygons``       `RaggedPolygons`: areas, lengths, resampling, simplicity
``raster``         polygons to pixels, meshes to voxels
``opencv``         OpenCV's operations on images, typed
``sections``       the loops in which a mesh meets parallel planes
``distance``       signed distances of masks, polygons and meshes
``thickness``      `Lines` that meet a mesh, and how thick its walls are
``grid``           `ScalarGrid`: values on a grid and their isosurface
``closed_splines`` points of closed cubic curves
=================  =================================================================================
"""
