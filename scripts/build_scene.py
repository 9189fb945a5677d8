"""All organs of a case in one scene, one segmentation and one list."""

from cccd.store import atomic_path, read_ply, write_json
from cccd_labels.scene import describe_scene, name_organs, write_scene, write_segmentation
from cccd_workflow.job import job
from cccd_workflow.stage_files import by_organ, read_structure_facts

case = snakemake.wildcards.case
with job(snakemake.log[0], case, snakemake.input, snakemake.output):
    meshes = by_organ(read_ply, snakemake.input.meshes)
    organs = name_organs(meshes, snakemake.params.labels)
    frame, _, _ = read_structure_facts(snakemake.input.structure)
    with atomic_path(snakemake.output.scene) as path:
        write_scene(path, organs)
    with atomic_path(snakemake.output.segmentation) as path:
        write_segmentation(path, organs, frame.of_file)
    write_json(snakemake.output.list, describe_scene(case, organs))
