//! Taking changes of the settings back.

use eframe::egui;

use crate::app::Viewer;
use crate::model::history::State;

impl Viewer {
    /// Records what the panels have changed, once nothing is dragged, typed or read again.
    pub(super) fn record_changes(&mut self, ctx: &egui::Context) {
        let busy = ctx.input(|input| input.pointer.any_down()) || ctx.text_edit_focused();
        if busy || self.opened.pending().is_some() {
            return;
        }
        let Some(document) = &self.opened.document else { return };
        self.history.record(State {
            source: document.source.clone(),
            scenes: self.stage.editing.scenes.clone(),
            processor: self.stage.processor,
            colors: self.stage.colors.clone(),
        });
    }

    /// Takes the last change back, or makes it again.
    pub(super) fn step_history(&mut self, forwards: bool) {
        let Some(document) = self.opened.document.clone() else { return };
        if self.opened.pending().is_some() {
            return;
        }
        let Some(state) = self.history.step(forwards).cloned() else { return };
        let State { source, scenes, processor, colors } = state;
        if source == document.source {
            (self.stage.editing.scenes, self.stage.colors) = (scenes, colors);
            self.stage.processor = processor;
        } else {
            self.reopen(source);
            self.opened.wishes.edits = Some(Box::new((scenes, colors)));
        }
    }
}
