//! The files that a worker reads: those of the user, and those of servers.

use std::io;
use std::path::Path;
use std::rc::Rc;

use js_sys::{ArrayBuffer, Uint8Array};
use limpid_io::files::given::{self, ReadAt};
use wasm_bindgen::{JsCast as _, JsValue};
use wasm_bindgen_futures::JsFuture;
use web_sys::{
    AbortController, DedicatedWorkerGlobalScope, File, FileReaderSync, RequestInit, Response,
    XmlHttpRequest, XmlHttpRequestResponseType,
};

use super::wire::text_of;
use crate::model::document::Source;

/// The worker, as the browser knows it.
pub(super) fn scope() -> DedicatedWorkerGlobalScope {
    js_sys::global().unchecked_into()
}

/// The folder of a drop, which all its files are in; empty for a URL.
pub(super) fn root_of(input: &str) -> &Path {
    let first = Path::new(input).components().next();
    let first = first.map_or(Path::new(""), |first| Path::new(first.as_os_str()));
    if first.to_string_lossy().ends_with(':') { Path::new("") } else { first }
}

/// A source as files are named: without the queries of its URLs.
pub(super) fn without_queries(source: &Source) -> Source {
    let scene = source.scene.as_ref().map(|scene| scene.to_string_lossy());
    Source {
        input: given::without_query(&source.input),
        scene: scene.map(|scene| given::without_query(&scene).into()),
        ..source.clone()
    }
}

/// Gives a file of the page to all who read files.
pub(super) fn give_file(path: &str, file: File) {
    let length = file.size() as u64;
    let read: ReadAt = Rc::new(move |offset, buffer| {
        let fail = |error: JsValue| io::Error::other(text_of(&error));
        let (start, end) = (offset as f64, (offset + buffer.len() as u64) as f64);
        let part = file.slice_with_f64_and_f64(start, end).map_err(fail)?;
        let reader = FileReaderSync::new().map_err(fail)?;
        let bytes = reader.read_as_array_buffer(&part).map_err(fail)?;
        let bytes = Uint8Array::new(&bytes);
        if bytes.length() as usize != buffer.len() {
            return Err(io::Error::other("it changed while it was read"));
        }
        bytes.copy_to(buffer);
        Ok(())
    });
    given::give(path, length, read);
}

/// Fetches a URL, waiting for the server, as a worker may: lists and small files, which are found while others are read.
pub(super) fn fetched_at_once(url: &str) -> io::Result<Vec<u8>> {
    /// Longest wait, ms.
    const PATIENCE: u32 = 60_000;
    let fail = |error: JsValue| {
        let problem = "the server cannot be reached, or does not let other sites read this (CORS)";
        io::Error::other(format!("{problem}: {}", text_of(&error)))
    };
    let request = XmlHttpRequest::new().map_err(fail)?;
    request.open_with_async("GET", url, false).map_err(fail)?;
    request.set_timeout(PATIENCE);
    request.set_response_type(XmlHttpRequestResponseType::Arraybuffer);
    request.send().map_err(fail)?;
    match request.status().unwrap_or_default() {
        200..=299 => {
            let body = request.response().map_err(fail)?;
            Ok(Uint8Array::new(&body.unchecked_into::<ArrayBuffer>()).to_vec())
        }
        404 | 410 => Err(io::ErrorKind::NotFound.into()),
        status => Err(io::Error::other(format!("the server answers {status}"))),
    }
}

/// Fetches a URL; `None` if that fails.
pub(super) async fn fetched(url: &str, abort: &AbortController) -> Option<Vec<u8>> {
    let options = RequestInit::new();
    options.set_signal(Some(&abort.signal()));
    let answer = JsFuture::from(scope().fetch_with_str_and_init(url, &options)).await.ok()?;
    let answer: Response = answer.unchecked_into();
    if !answer.ok() {
        return None;
    }
    let body = JsFuture::from(answer.array_buffer().ok()?).await.ok()?;
    Some(Uint8Array::new(&body).to_vec())
}
