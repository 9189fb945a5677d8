"""The configuration: one typed model per stage, with default, range, unit and reason of every key.

From the models come ``config/config.yaml``, ``workflow/schemas/config.schema.yaml`` and
``docs/configuration.md`` (``python docs/settings_pages.py`` writes them). Each stage imports its own module,
so that an edit of one stage's settings runs no other again; `cccd.settings.root` holds them all.
"""
