//! Binary data of glTF: buffers in files, in the document and in GLB, and the accessors that read them.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, Engine as _, GeneralPurpose, GeneralPurposeConfig};
use limpid::memory;

use super::document::{Accessor, Document};
use crate::budget::Budget;
use crate::error::{Error, Location, Result};
use crate::files;
use crate::particles::table::{Column, Scalar};

/// The buffers of a document.
pub(super) struct Buffers<'a> {
    path: &'a Path,
    document: &'a Document,
    buffers: Vec<Arc<Cow<'a, [u8]>>>,
}

impl<'a> Buffers<'a> {
    /// Reads all buffers; `binary` is the binary chunk of GLB.
    pub(super) fn read(
        path: &'a Path,
        document: &'a Document,
        binary: Option<&'a [u8]>,
        budget: &Budget,
    ) -> Result<Self> {
        let mut this = Self { path, document, buffers: Vec::new() };
        // A file that several buffers name is read once.
        let mut known: HashMap<PathBuf, Arc<Cow<'_, [u8]>>> = HashMap::new();
        for (i, buffer) in document.buffers.iter().enumerate() {
            let name = format!("buffers[{i}]");
            let bytes = match &buffer.uri {
                None if i == 0 && binary.is_some() => {
                    Arc::new(Cow::Borrowed(binary.unwrap_or_default()))
                }
                None => return Err(this.without(&name, "no data (`uri`)")),
                Some(uri) => match embedded(uri) {
                    Some(bytes) => {
                        Arc::new(Cow::Owned(bytes.map_err(|problem| this.error(&name, &problem))?))
                    }
                    None => {
                        let beside = file_beside(path, uri);
                        let beside = beside.map_err(|problem| this.unread(&name, &problem))?;
                        let key = beside.canonicalize().unwrap_or_else(|_| beside.clone());
                        match known.get(&key) {
                            Some(bytes) => bytes.clone(),
                            None => {
                                let mut bytes = Vec::new();
                                files::read(&beside, |_| u64::MAX, &mut bytes)?;
                                budget.add_file(&beside, bytes.len() as u64);
                                // Under many names, links alike, it takes memory many times.
                                budget.take(bytes.len() as u64, &beside, Location::Byte(0))?;
                                let bytes = Arc::new(Cow::Owned(bytes));
                                known.insert(key, Arc::clone(&bytes));
                                bytes
                            }
                        }
                    }
                },
            };
            let (declared, found) = (buffer.byte_length, bytes.len());
            if declared > found {
                let problem = format!("`byteLength` is {declared}, but there are {found} bytes");
                return Err(this.error(&name, &problem));
            }
            this.buffers.push(bytes);
        }
        Ok(this)
    }

    /// The error of a part of the document that is damaged.
    pub(super) fn error(&self, part: &str, problem: &str) -> Error {
        Error::malformed(self.path, Location::Part(part.to_owned()), problem)
    }

    /// The error of a part of the document with an unsupported feature.
    pub(super) fn unread(&self, part: &str, problem: &str) -> Error {
        Error::format(self.path, format!("{part}: {problem}"))
    }

    /// The error of a part without data, which may be due to compression.
    fn without(&self, part: &str, problem: &str) -> Error {
        let used = self.document.extensions_used.iter();
        match used.into_iter().find(|name| name.ends_with("_compression")) {
            Some(name) => {
                let remedy = format!("{name} is not read, export without compression");
                self.unread(part, &format!("{problem}; {remedy}"))
            }
            None => self.error(part, problem),
        }
    }

    /// The bytes of a buffer view, and the distance of its items, if it has one.
    pub(super) fn view(&self, index: usize, part: &str) -> Result<(&[u8], Option<usize>)> {
        let Some(view) = self.document.buffer_views.get(index) else {
            return Err(self.error(part, &format!("bufferViews[{index}] does not exist")));
        };
        let fail = |problem: &str| self.error(&format!("bufferViews[{index}]"), problem);
        let Some((buffer, declared)) =
            self.buffers.get(view.buffer).zip(self.document.buffers.get(view.buffer))
        else {
            return Err(fail(&format!("buffers[{}] does not exist", view.buffer)));
        };
        let buffer = buffer.get(..declared.byte_length).unwrap_or_default();
        let bytes = buffer.get(view.byte_offset..).and_then(|rest| rest.get(..view.byte_length));
        let bytes = bytes.ok_or_else(|| {
            let (from, length, all) = (view.byte_offset, view.byte_length, buffer.len());
            fail(&format!("{length} bytes from byte {from} are not within the buffer's {all}"))
        })?;
        Ok((bytes, view.byte_stride))
    }

    fn accessor(&self, index: usize, part: &str) -> Result<&'a Accessor> {
        let accessor = self.document.accessors.get(index);
        accessor.ok_or_else(|| self.error(part, &format!("accessors[{index}] does not exist")))
    }

    /// Number of items of an accessor.
    pub(super) fn count(&self, index: usize, part: &str) -> Result<usize> {
        Ok(self.accessor(index, part)?.count)
    }

    /// Reads the vectors of an accessor, which are floats unless the document says that they may be integers.
    pub(super) fn vectors(&self, index: usize, part: &str) -> Result<Vec<[f64; 3]>> {
        let accessor = self.accessor(index, part)?;
        let part = &format!("accessors[{index}]");
        // 32-bit integers are none of the extension's.
        let scalar = self.scalar(accessor.component_type, part)?;
        let is_integer = !matches!(scalar, Scalar::F32 | Scalar::U32);
        let extension = "KHR_mesh_quantization";
        let document = self.document;
        let mut named = document.extensions_used.iter().chain(&document.extensions_required);
        if is_integer && !named.any(|name| name == extension) {
            let problem =
                format!("`componentType` {} without {extension}", accessor.component_type);
            return Err(self.error(part, &problem));
        }
        self.items::<3>(index, "VEC3", part)
    }

    /// Reads the items of an accessor, of `N` numbers each; `kind` is their type, such as `VEC3`.
    pub(super) fn items<const N: usize>(
        &self,
        index: usize,
        kind: &str,
        part: &str,
    ) -> Result<Vec<[f64; N]>> {
        let accessor = self.accessor(index, part)?;
        let part = &format!("accessors[{index}]");
        if accessor.kind != kind {
            return Err(
                self.error(part, &format!("the type is {}, expected {kind}", accessor.kind))
            );
        }
        let scalar = self.scalar(accessor.component_type, part)?;
        if N > 1 && scalar == Scalar::U32 {
            let problem = "32-bit integers (`componentType` 5125), which are for indices alone";
            return Err(self.error(part, problem));
        }
        let Some(view) = accessor.buffer_view else {
            return Err(self.without(part, "no data (`bufferView`)"));
        };
        let normalized = if accessor.normalized { largest(scalar) } else { None };
        let number = |column: Column, bytes: &[u8]| {
            let number = column.number(bytes, false);
            normalized.map_or(number, |largest| (number / largest).max(-1.0))
        };
        let read = |view: usize, offset: usize, count: usize| -> Result<Vec<[f64; N]>> {
            let (bytes, stride) = self.strided(view, offset, count, N * scalar.size(), part)?;
            let mut items = memory::reserve(count, self.path.display())?;
            let columns: [Column; N] =
                std::array::from_fn(|k| Column { offset: k * scalar.size(), scalar });
            let records = (0..count).map(|i| bytes.get(i * stride..).unwrap_or_default());
            items.extend(records.map(|record| columns.map(|column| number(column, record))));
            Ok(items)
        };
        let mut items = read(view, accessor.byte_offset, accessor.count)?;
        if let Some(sparse) = &accessor.sparse {
            if sparse.count > accessor.count {
                let problem = format!("{} sparse values of {}", sparse.count, accessor.count);
                return Err(self.error(part, &problem));
            }
            let values = read(sparse.values.buffer_view, sparse.values.byte_offset, sparse.count)?;
            let at = &sparse.indices;
            let scalar = self.scalar(at.component_type, part)?;
            let (indices, stride) =
                self.strided(at.buffer_view, at.byte_offset, sparse.count, scalar.size(), part)?;
            for (i, value) in values.into_iter().enumerate() {
                let index = scalar.number(indices.get(i * stride..).unwrap_or_default(), false);
                let item = items.get_mut(index as usize).ok_or_else(|| {
                    let problem = format!("sparse index {index} of {} items", accessor.count);
                    self.error(part, &problem)
                })?;
                *item = value;
            }
        }
        Ok(items)
    }

    /// The bytes of `count` items of `size` bytes from an offset of a view, and their distance.
    fn strided(
        &self,
        view: usize,
        offset: usize,
        count: usize,
        size: usize,
        part: &str,
    ) -> Result<(&[u8], usize)> {
        let (bytes, stride) = self.view(view, part)?;
        let stride = stride.unwrap_or(size);
        if stride < size {
            let problem = format!("`byteStride` {stride} of items of {size} bytes");
            return Err(self.error(part, &problem));
        }
        let before_last = count.saturating_sub(1).checked_mul(stride);
        let last = if count == 0 { 0 } else { size };
        let length = before_last.and_then(|length| length.checked_add(last));
        let bytes =
            bytes.get(offset..).filter(|rest| length.is_some_and(|length| length <= rest.len()));
        let bytes = bytes.ok_or_else(|| {
            let problem =
                format!("{count} items from byte {offset} are not within bufferViews[{view}]");
            self.error(part, &problem)
        })?;
        Ok((bytes, stride))
    }

    fn scalar(&self, component: u64, part: &str) -> Result<Scalar> {
        Ok(match component {
            5120 => Scalar::I8,
            5121 => Scalar::U8,
            5122 => Scalar::I16,
            5123 => Scalar::U16,
            5125 => Scalar::U32,
            5126 => Scalar::F32,
            _ => return Err(self.error(part, &format!("unknown `componentType` {component}"))),
        })
    }
}

/// The integer that means 1 in a normalized accessor.
fn largest(scalar: Scalar) -> Option<f64> {
    match scalar {
        Scalar::I8 => Some(i8::MAX.into()),
        Scalar::U8 => Some(u8::MAX.into()),
        Scalar::I16 => Some(i16::MAX.into()),
        Scalar::U16 => Some(u16::MAX.into()),
        _ => None,
    }
}

/// The bytes of a `data:` URI, or the problem; `None` for other URIs.
pub(super) fn embedded(uri: &str) -> Option<Result<Vec<u8>, String>> {
    /// With or without padding, as both are written.
    const BASE64: GeneralPurpose = GeneralPurpose::new(
        &STANDARD,
        GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
    );
    let rest = uri.strip_prefix("data:")?;
    let Some((_, data)) = rest.split_once(',').filter(|(kind, _)| kind.ends_with(";base64")) else {
        return Some(Err("a `data:` URI without base64".into()));
    };
    Some(BASE64.decode(data).map_err(|error| format!("not base64: {error}")))
}

/// The path of a file that a relative URI names.
pub(super) fn file_beside(path: &Path, uri: &str) -> Result<PathBuf, String> {
    let scheme = uri.split_once(':').map(|(scheme, _)| scheme);
    // One letter is a drive.
    if scheme.is_some_and(|s| s.len() > 1 && s.bytes().all(|byte| byte.is_ascii_alphanumeric())) {
        return Err(format!("`{uri}` is no file beside the mesh"));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    Ok(folder.join(decoded(uri)))
}

/// Text with `%20` and the like decoded.
fn decoded(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let code = after.get(..2).filter(|_| first == b'%');
        let code =
            code.and_then(|code| u8::from_str_radix(std::str::from_utf8(code).ok()?, 16).ok());
        bytes.push(code.unwrap_or(first));
        rest = if code.is_some() { &after[2..] } else { after };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}
