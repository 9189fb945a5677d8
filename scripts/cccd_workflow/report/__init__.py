"""The report: pictures, tables, figures and a page that shows the surface in three dimensions.

Entry points are in `cccd_workflow.report.page` (the pages) and `cccd_workflow.report.render` (a picture of a
surface). Nothing is imported here, so that drawing a picture does not depend on what the page is made of.
"""
