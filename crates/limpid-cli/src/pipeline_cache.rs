//! What the driver has compiled, kept in the user's cache folder, so that the next run need not
//! compile it again.
//!
//! Vulkan's drivers give it out as bytes that none but they understand, and believe what they are
//! given back. So a file says what it was made by, and a checksum of all of it; anything else is no
//! file, and is replaced. Nothing that happens to it is an error: a run without it takes longer.

use std::fs;
use std::hash::Hasher as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use limpid::gpu::Gpu;
use limpid::wgpu;
use limpid_io::output::{self, FileKind};
use siphasher::sip128::{Hasher128 as _, SipHasher24};

/// Bytes of the checksum that a file begins with.
const CHECKSUM: usize = 16;

/// A larger file is nobody's: of limpid's shaders a driver makes a few MiB.
const LARGEST: u64 = 256 << 20;

/// The compiled pipelines of one adapter.
pub(crate) struct PipelineCache {
    cache: wgpu::PipelineCache,
    path: PathBuf,
    /// What they are compiled by.
    maker: String,
    /// What the file holds now.
    held: Option<Vec<u8>>,
}

/// Opens an adapter as [`device::open`], with what earlier runs have compiled.
///
/// # Errors
/// As [`device::open`].
pub(crate) fn open_adapter() -> limpid_io::Result<(Gpu, Option<PipelineCache>)> {
    let gpu = limpid_io::device::open()?;
    match folder().and_then(|folder| PipelineCache::open(&gpu.device, &folder)) {
        Some(cache) => Ok((gpu.with_pipeline_cache(cache.cache.clone()), Some(cache))),
        None => Ok((gpu, None)),
    }
}

impl PipelineCache {
    /// None if the adapter has no such thing.
    fn open(device: &wgpu::Device, folder: &Path) -> Option<Self> {
        if !device.features().contains(wgpu::Features::PIPELINE_CACHE) {
            return None;
        }
        let info = device.adapter_info();
        let adapter = format!("{:?} {:04x} {:04x}", info.backend, info.vendor, info.device);
        let maker = format!(
            "limpid {}, {adapter}, {}, {}, {}",
            env!("CARGO_PKG_VERSION"),
            info.name,
            info.driver,
            info.driver_info
        );
        // By the adapter alone: what another version has left is replaced, not added to.
        let name = format!("pipelines-{}.bin", adapter.replace(' ', "-").to_lowercase());
        let path = folder.join(name);
        let held = read(&path, &maker);
        let cache = held
            .as_deref()
            .and_then(|data| create(device, Some(data)))
            .or_else(|| create(device, None))?;
        Some(Self { cache, path, maker, held })
    }

    /// Writes what is new.
    pub(crate) fn save(&self) {
        let Some(data) = self.cache.get_data() else { return };
        if self.held.as_ref() == Some(&data) || data.len() as u64 > LARGEST {
            return;
        }
        // The next run compiles what this one could not keep.
        let Some(Ok(())) = self.path.parent().map(create_folder) else { return };
        let sum = checksum(&self.maker, &data).to_le_bytes();
        let _ = output::write_atomically(&self.path, FileKind::CACHE, |file| {
            file.write_all(&sum)?;
            file.write_all(&data)
        });
    }
}

/// A cache that begins with `data`, the bytes of an earlier one; none if the device refuses them.
#[expect(unsafe_code, reason = "drivers believe the bytes that they are given")]
fn create(device: &wgpu::Device, data: Option<&[u8]>) -> Option<wgpu::PipelineCache> {
    let label = Some("limpid");
    let descriptor = wgpu::PipelineCacheDescriptor { label, data, fallback: true };
    let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
    // SAFETY: `data` is what `get_data` returned to this version of limpid for this adapter and
    // driver: the checksum is of these and of every byte. To forge it is to write to the user's own
    // cache folder, where the driver keeps its machine code too.
    let cache = unsafe { device.create_pipeline_cache(&descriptor) };
    pollster::block_on(scope.pop()).is_none().then_some(cache)
}

/// The bytes in a file that `maker` has written and nobody has changed.
fn read(path: &Path, maker: &str) -> Option<Vec<u8>> {
    let bytes = limpid_io::input::read(path, LARGEST + CHECKSUM as u64).ok()?;
    let (sum, data) = bytes.split_first_chunk::<CHECKSUM>()?;
    (checksum(maker, data).to_le_bytes() == *sum).then(|| data.to_vec())
}

fn checksum(maker: &str, data: &[u8]) -> u128 {
    let mut hasher = SipHasher24::new();
    hasher.write(maker.as_bytes());
    // Ends the name, which holds no such byte.
    hasher.write(&[0]);
    hasher.write(data);
    hasher.finish128().as_u128()
}

/// Private, as what is executed should be.
fn create_folder(folder: &Path) -> std::io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.recursive(true).create(folder)
}

/// `limpid` in the user's cache folder: `$XDG_CACHE_HOME`, `~/.cache`, or on Windows
/// `%LOCALAPPDATA%`.
fn folder() -> Option<PathBuf> {
    let variable = |name: &str| std::env::var_os(name).map(PathBuf::from);
    // Relative paths are to be ignored (XDG Base Directory Specification).
    let whole = |path: &PathBuf| path.is_absolute();
    let cache = variable("XDG_CACHE_HOME").filter(whole);
    let cache = cache.or_else(|| variable("LOCALAPPDATA").filter(whole));
    let cache = cache.or_else(|| Some(variable("HOME").filter(whole)?.join(".cache")));
    Some(cache?.join("limpid"))
}
