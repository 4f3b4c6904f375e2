//! Compiled pipelines, kept in the user's cache folder so that the next run does not compile them again.
//!
//! Vulkan drivers return them as opaque bytes, and trust the bytes that they are given back. So a file
//! begins with a checksum of its data and of the identity of their compiler; a file with another checksum
//! is ignored and replaced. No failure is an error: a run without the cache takes longer.

use std::fs;
use std::hash::Hasher as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use limpid::gpu::Gpu;
use limpid::wgpu;
use limpid_io::output::{self, FileKind};
use siphasher::sip128::{Hasher128 as _, SipHasher24};

/// Size of the checksum at the beginning of a file, bytes.
const CHECKSUM: usize = 16;

/// Largest accepted file, bytes: drivers compile limpid's shaders to a few MiB.
const MAX_BYTES: u64 = 256 << 20;

/// Adapter and versions that measurements and compiled pipelines depend on.
pub(crate) struct Identity {
    /// The adapter, as a part of a file's name.
    pub(crate) adapter: String,
    /// Limpid's version, the adapter and the driver.
    pub(crate) compiler: String,
}

impl Identity {
    pub(crate) fn of(device: &wgpu::Device) -> Self {
        let info = device.adapter_info();
        let adapter = format!("{:?} {:04x} {:04x}", info.backend, info.vendor, info.device);
        let (version, driver) = (env!("CARGO_PKG_VERSION"), &info.driver);
        let compiler =
            format!("limpid {version}, {adapter}, {}, {driver}, {}", info.name, info.driver_info);
        Self { adapter: adapter.replace(' ', "-").to_lowercase(), compiler }
    }
}

/// The compiled pipelines of one adapter.
#[derive(Debug)]
pub struct PipelineCache {
    cache: wgpu::PipelineCache,
    path: PathBuf,
    /// [`Identity::compiler`].
    compiler: String,
    /// The data in the file at present.
    stored: Option<Vec<u8>>,
}

/// Opens an adapter as [`limpid_io::device::open`], with the pipelines that earlier runs have compiled.
///
/// # Errors
/// As [`limpid_io::device::open`].
pub fn open_adapter() -> limpid_io::Result<(Gpu, Option<PipelineCache>)> {
    Ok(with_cache(limpid_io::device::open()?))
}

/// As [`open_adapter`], for the adapter whose name contains `wanted`.
///
/// # Errors
/// As [`limpid_io::device::open_named`].
pub fn open_adapter_named(wanted: &str) -> limpid_io::Result<(Gpu, Option<PipelineCache>)> {
    Ok(with_cache(limpid_io::device::open_named(wanted)?))
}

/// The device with the compiled pipelines of its adapter, if it can use any.
fn with_cache(gpu: Gpu) -> (Gpu, Option<PipelineCache>) {
    match output::cache_folder().and_then(|folder| PipelineCache::open(&gpu.device, &folder)) {
        Some(cache) => (gpu.with_pipeline_cache(cache.cache.clone()), Some(cache)),
        None => (gpu, None),
    }
}

impl PipelineCache {
    /// Opens the cache in `folder`; `None` if the adapter has no pipeline caches.
    fn open(device: &wgpu::Device, folder: &Path) -> Option<Self> {
        if !device.features().contains(wgpu::Features::PIPELINE_CACHE) {
            return None;
        }
        let Identity { adapter, compiler } = Identity::of(device);
        // Named by the adapter alone, so that a new version replaces the file of an old one.
        let name = format!("pipelines-{adapter}.bin");
        let path = folder.join(name);
        let stored = read(&path, &compiler);
        let cache = stored
            .as_deref()
            .and_then(|data| create(device, Some(data)))
            .or_else(|| create(device, None))?;
        Some(Self { cache, path, compiler, stored })
    }

    /// Writes the file if the data have changed.
    pub fn save(&self) {
        let Some(data) = self.cache.get_data() else { return };
        if self.stored.as_ref() == Some(&data) || data.len() as u64 > MAX_BYTES {
            return;
        }
        // If the data cannot be written, the next run compiles the pipelines again.
        let Some(Ok(())) = self.path.parent().map(create_folder) else { return };
        let sum = checksum(&self.compiler, &data).to_le_bytes();
        let _ = output::write_atomically(&self.path, FileKind::CACHE, |file| {
            file.write_all(&sum)?;
            file.write_all(&data)
        });
    }
}

/// Creates a cache initialized with `data` of an earlier one; `None` if the device refuses them.
#[expect(unsafe_code, reason = "drivers trust the bytes that they are given")]
fn create(device: &wgpu::Device, data: Option<&[u8]>) -> Option<wgpu::PipelineCache> {
    let label = Some("limpid");
    let descriptor = wgpu::PipelineCacheDescriptor { label, data, fallback: true };
    let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
    // SAFETY: `data` are the bytes that `get_data` returned to this version of limpid for this adapter
    // and driver, since the checksum covers all of these. Forging it requires write access to the user's
    // own cache folder, where the driver keeps its machine code too.
    let cache = unsafe { device.create_pipeline_cache(&descriptor) };
    pollster::block_on(scope.pop()).is_none().then_some(cache)
}

/// Reads the data of a file whose checksum matches `compiler` and the data.
fn read(path: &Path, compiler: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    limpid_io::files::read(path, |_| MAX_BYTES + CHECKSUM as u64, &mut bytes).ok()?;
    let (sum, data) = bytes.split_first_chunk::<CHECKSUM>()?;
    (checksum(compiler, data).to_le_bytes() == *sum).then(|| data.to_vec())
}

fn checksum(compiler: &str, data: &[u8]) -> u128 {
    let mut hasher = SipHasher24::new();
    hasher.write(compiler.as_bytes());
    // Terminates the text, which contains no such byte.
    hasher.write(&[0]);
    hasher.write(data);
    hasher.finish128().as_u128()
}

/// Creates a folder that only the user can access, since the pipelines are executed.
pub(crate) fn create_folder(folder: &Path) -> std::io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.recursive(true).create(folder)
}
