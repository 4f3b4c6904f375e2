//! The viewer of limpid for web pages, as JavaScript calls it. The page is in `page/`, and the viewer itself in
//! `limpid-viewer`; `scripts/web.sh` builds both into a folder for any server.

#![cfg(target_arch = "wasm32")]

#[path = "../../limpid-viewer/examples/live/drawing.rs"]
mod drawing;
#[path = "../../limpid-viewer/examples/live/simulation.rs"]
mod simulation;

use std::cell::RefCell;
use std::collections::BTreeMap;

use eframe::{WebOptions, WebRunner};
use glam::UVec2;
use js_sys::Array;
use limpid::frame::Picture;
use limpid::gpu::Gpu;
use limpid::gpu::shader::{RENDERER, Words};
use limpid_viewer::app::page::{Page, PageOptions};
use wasm_bindgen::prelude::wasm_bindgen;
use wasm_bindgen::{JsCast as _, JsError, JsValue};
use web_sys::{File, HtmlCanvasElement};

/// Runs the worker of a page; to be called in a worker.
#[wasm_bindgen]
pub fn work() {
    limpid_viewer::backend::web::work();
}

/// Every shader of the renderer, with every intersector where one is chosen: a list of names and texts in WGSL, for
/// tests. Browsers check more than the program does.
#[wasm_bindgen]
pub fn shaders() -> Array {
    let is_intersector =
        |root: &&&str| root.starts_with("refract/") && **root != "refract/structure.wgsl";
    let intersectors: Vec<&str> = RENDERER.roots.iter().filter(is_intersector).copied().collect();
    let mut all = BTreeMap::new();
    for root in RENDERER.roots {
        for intersector in &intersectors {
            for mips in [false, true] {
                let variant = Words { mips, ..Words::of(intersector) };
                all.insert(RENDERER.source(root, variant), format!("{root} with {intersector}"));
            }
        }
    }
    all.into_iter()
        .map(|(text, name)| [name, text].map(JsValue::from).iter().collect::<Array>())
        .collect()
}

/// A viewer in a canvas.
#[wasm_bindgen]
pub struct View {
    page: Page,
    /// The runner of the canvas that is shown.
    runner: RefCell<WebRunner>,
}

#[wasm_bindgen]
impl View {
    /// Creates a viewer that opens what `query` names, a list of names and values, or a demo. `host` has the functions
    /// of [`PageOptions::host`]; a `plain` view has no toolbar and no panels; `width` and `height` are the element's.
    #[wasm_bindgen(constructor)]
    pub fn new(host: JsValue, query: &Array, plain: bool, width: u32, height: u32) -> Self {
        let size = UVec2::new(width, height);
        let page = Page::new(PageOptions { host, query: pairs(query), plain, size });
        Self { page, runner: RefCell::new(WebRunner::new()) }
    }

    /// Shows the viewer in a canvas. Another one may take its place once that has lost its context.
    ///
    /// # Errors
    /// Without WebGL 2.
    pub async fn show(&self, canvas: HtmlCanvasElement) -> Result<(), JsValue> {
        let runner = self.runner.borrow().clone();
        let page = self.page.clone();
        let create = move |_: &eframe::CreationContext<'_>| Ok(page.app());
        let options = WebOptions { dithering: false, ..WebOptions::default() };
        runner.start(canvas, options, Box::new(create)).await
    }

    /// Leaves a canvas that has lost its context.
    pub fn leave(&self) {
        self.runner.replace(WebRunner::new()).destroy();
        self.page.leave();
    }

    /// Message of the panic that ended the viewer, if one has.
    #[wasm_bindgen(js_name = failure)]
    pub fn failure(&self) -> Option<String> {
        self.runner.borrow().panic_summary().map(|summary| summary.message())
    }

    /// Opens the URL of a scene, of particles, of a pattern or of a folder, which ends with a slash.
    pub fn open(&self, url: &str) {
        self.page.open(url);
    }

    /// Opens files of the user: a list of paths, with `File`s.
    #[wasm_bindgen(js_name = openFiles)]
    pub fn open_files(&self, files: &Array) {
        let file = |pair: JsValue| {
            let pair: Array = pair.dyn_into().ok()?;
            Some((pair.get(0).as_string()?, pair.get(1).dyn_into::<File>().ok()?))
        };
        let files: Vec<_> = files.iter().filter_map(file).collect();
        self.page.open_files(&files);
    }

    /// Opens the source in the parameters of an address.
    ///
    /// # Errors
    /// Naming a parameter and its problem.
    #[wasm_bindgen(js_name = openQuery)]
    pub fn open_query(&self, query: &Array) -> Result<(), JsError> {
        Ok(self.page.open_query(&pairs(query))?)
    }

    /// Changes settings, as `--set` of the program: `refract.samples=4`.
    ///
    /// # Errors
    /// Naming a setting and its problem.
    pub fn set(&self, settings: Vec<String>) -> Result<(), JsError> {
        Ok(self.page.set(&settings)?)
    }

    /// Sets the camera, as `--camera` of the program: `eye=1,2,3 target=0,0,0 fov_y=40`.
    ///
    /// # Errors
    /// Message naming the wrong parameter.
    pub fn camera(&self, camera: &str) -> Result<(), JsError> {
        Ok(self.page.set_camera(camera)?)
    }

    /// Plays or pauses.
    pub fn play(&self, playing: bool) {
        self.page.play(playing);
    }

    /// Goes to the frame of an index, from 0.
    pub fn seek(&self, index: usize) {
        self.page.seek(index);
    }

    /// Draws the picture at rest at another size, and has the page save it: PNG, JPEG, WebP or OpenEXR.
    pub fn save(&self, name: &str, width: u32, height: u32, samples: u32) {
        self.page.save(name, UVec2::new(width, height), samples);
    }

    /// The parameters of an address that opens this picture; nothing for files of the user.
    pub fn query(&self) -> Option<String> {
        self.page.query()
    }

    /// State of the page, as JSON.
    pub fn status(&self) -> String {
        self.page.status()
    }

    /// Loses the graphics device, for tests.
    #[wasm_bindgen(js_name = loseDevice)]
    pub fn lose_device(&self) {
        self.page.lose_device();
    }
}

/// A liquid that is simulated and drawn on the graphics device: only its pictures leave that.
#[wasm_bindgen]
pub struct Live {
    gpu: Gpu,
    live: drawing::Live,
    picture: Option<Picture>,
}

#[wasm_bindgen]
impl Live {
    /// Begins a simulation of `count` particles.
    ///
    /// # Errors
    /// Without WebGPU.
    pub async fn begin(count: u32) -> Result<Self, JsError> {
        let gpu = Gpu::request().await?;
        let live = drawing::Live::new(&gpu, count)?;
        Ok(Self { gpu, live, picture: None })
    }

    /// Simulates a frame of 1/60 s, and draws it from the angle `turn`, radians: four bytes for each pixel, by rows.
    ///
    /// # Errors
    /// For sizes that the device cannot draw, and once it is lost.
    pub async fn frame(&mut self, width: u32, height: u32, turn: f64) -> Result<Vec<u8>, JsError> {
        let size = UVec2::new(width, height).max(UVec2::ONE);
        let picture = match self.picture.take_if(|picture| picture.size() == size) {
            Some(picture) => picture,
            None => Picture::new(&self.gpu, size)?,
        };
        self.live.step();
        self.live.draw(&picture, size, turn)?;
        let pixels = picture.begin_reading(&self.gpu).ready(&self.gpu).await?;
        self.picture = Some(picture);
        Ok(pixels.into_raw())
    }
}

fn pairs(list: &Array) -> Vec<(String, String)> {
    let pair = |pair: JsValue| {
        let pair: Array = pair.dyn_into().ok()?;
        Some((pair.get(0).as_string()?, pair.get(1).as_string()?))
    };
    list.iter().filter_map(pair).collect()
}
