"""Training of the networks that order boundary pixels, and of what chooses among alternatives of the cut.

==================== ===============================================================================
module               holds
==================== ===============================================================================
``random_masks``     synthetic organs; ``synthetic_images``, ``synthetic_maps``, ``labels``: images, noisy
                     boundary maps (`cccd_datasets.corruptions`) and labels of them
``families``         boundary maps of other causes: edges of images, torn outlines, edge detectors
``frozen_graphs``    ``graphs.h5``: graphs drawn once
``data``             labelled maps
``tasks``            a network, its batches, its loss and its scores; ``loss``: ours
``loop``             epochs, validation and what comes out; ``start``: where it begins
``scoring``          when an ordered slice counts as correct
``reranker``         training of `cccd_junctions.reranking`, once, by hand
==================== ===============================================================================
"""
