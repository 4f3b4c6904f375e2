//! Waiting in the worker: for a change, and for the browser's turn.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::task::{Poll, Waker};

use js_sys::{Function, Promise, Reflect};
use wasm_bindgen::{JsCast as _, JsValue};
use wasm_bindgen_futures::JsFuture;

/// Wakes tasks that wait for a change.
#[derive(Default)]
pub(super) struct Signal {
    changes: Cell<u64>,
    waiting: RefCell<Vec<Waker>>,
}

impl Signal {
    /// Announces a change.
    pub(super) fn notify(&self) {
        self.changes.set(self.changes.get() + 1);
        self.waiting.take().into_iter().for_each(Waker::wake);
    }

    /// Number of changes so far.
    pub(super) fn changes(&self) -> u64 {
        self.changes.get()
    }

    /// Waits until there have been more than `seen` changes.
    pub(super) async fn after(self: &Rc<Self>, seen: u64) {
        std::future::poll_fn(|context| {
            if self.changes.get() > seen {
                return Poll::Ready(());
            }
            self.waiting.borrow_mut().push(context.waker().clone());
            Poll::Pending
        })
        .await;
    }
}

/// Lets the browser deliver messages, and other tasks proceed.
pub(super) async fn turn() {
    let promise = Promise::new(&mut |resolve: Function, _: Function| {
        let timeout = Reflect::get(&js_sys::global(), &"setTimeout".into());
        if let Ok(timeout) = timeout.and_then(|timeout| timeout.dyn_into::<Function>()) {
            // It is there in every browser.
            let _ = timeout.call2(&JsValue::UNDEFINED, &resolve, &0.into());
        }
    });
    let _ = JsFuture::from(promise).await;
}
