"""Help and about name everything that there is."""

import re

from app.presets.words import model_word
from app.shared.log import log_file
from app.views.controls.app_menu import ENTRIES
from app.views.dialogs.help_dialog import HelpDialog, help_parts
from engine.models import MODELS as KNOWN_MODELS


def test_help_has_every_key_view_and_model(qtbot, controller):
    controller.window.action["help"].trigger()
    dialog = controller.window.findChild(HelpDialog)
    assert dialog.isVisible()
    assert not dialog.isModal()
    texts = {dialog.tabs.tabText(row): dialog.tabs.widget(row).toPlainText() for row in range(dialog.tabs.count())}
    for entry in ENTRIES.values():
        assert entry.key_name in texts["Keys"]
        assert not entry.key or entry.does in texts["Keys"]
    for panel in controller.panels:
        assert panel.title in texts["Views"]
        assert panel.help, panel.key
        assert panel.help in texts["Views"]
    models = re.findall(r"^### (.+)$", help_parts()["Models"], re.MULTILINE)
    assert set(models) == {model_word(model) for model in KNOWN_MODELS}  # as presets are named
    for title in models:
        assert title in texts["Models"]
    assert str(log_file()) in texts["Errors"]
    controller.window.action["about"].trigger()
    assert dialog.tabs.tabText(dialog.tabs.currentIndex()) == "About" and "DAFx24" in texts["About"]
    dialog.close()
