//! The contents of pictures, which are known when they are asked for and shown with them.

use std::collections::BTreeMap;

use crate::model::views::View;
use limpid_io::color_by::ColorScale;
use limpid_io::input::FrameTime;

/// The contents of a picture: names, numbers and legends on the screen are those of the picture there, however late the
/// next one is.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Caption {
    /// The time of the particles.
    pub(crate) at: Option<FrameTime>,
    pub(crate) view: View,
    /// The values that its particles' colours show.
    pub(crate) scale: Option<ColorScale>,
}

/// The captions of requests that have not been answered.
#[derive(Debug, Default)]
pub(crate) struct Captions(BTreeMap<u64, Vec<Caption>>);

impl Captions {
    /// Notes a request, with the contents of each of its pictures.
    pub(crate) fn asked(&mut self, number: u64, captions: Vec<Caption>) {
        self.0.insert(number, captions);
    }

    /// The contents of the pictures of an answer; `None` if they are not wanted any more. Requests before it have been
    /// replaced.
    pub(crate) fn answered(&mut self, number: u64) -> Option<Vec<Caption>> {
        let later = self.0.split_off(&(number + 1));
        std::mem::replace(&mut self.0, later).remove(&number)
    }

    /// Withdraws all requests: another document or view is shown. Their answers may still come.
    pub(crate) fn withdraw(&mut self) {
        self.0.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An answer has the captions of its own request, once, and none after that has been withdrawn.
    #[test]
    fn withdrawn_requests_have_no_captions() {
        let caption =
            |frame| vec![Caption { at: Some(FrameTime::at(frame)), ..Caption::default() }];
        let mut captions = Captions::default();
        for number in 1..=4 {
            captions.asked(number, caption(10 * number as i64));
        }
        // The third replaced the second, which has no answer.
        assert_eq!(captions.answered(1), Some(caption(10)));
        assert_eq!(captions.answered(3), Some(caption(30)));
        assert_eq!(captions.answered(3), None);
        captions.withdraw();
        assert_eq!(captions.answered(4), None);
    }
}
