"""What this package adds to the core: see `cccd.plugins`."""

from cccd.plugins import Command

API = {"compare": "cccd_workflow.comparison.compare"}
COMMANDS = {
    "compare": Command("compare two surfaces, masks or label maps", "cccd_workflow.commands.add_compare"),
    "run": Command("run the whole workflow on a cohort", "cccd_workflow.commands.add_run"),
    "report": Command(
        "build the report of all finished structures again", "cccd_workflow.commands.add_report"
    ),
    "export": Command(
        "write a finished structure of the workflow in another format", "cccd_workflow.commands.add_export"
    ),
    "next": Command("name the slice to annotate next", "cccd_workflow.commands.add_next"),
    "check": Command("report what an input contains, and draw it", "cccd_workflow.check.add_check"),
    "doctor": Command("report what is installed and works", "cccd_workflow.doctor.add_doctor"),
}
