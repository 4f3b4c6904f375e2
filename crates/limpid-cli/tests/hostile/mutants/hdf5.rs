//! HDF5 by its specification (The HDF Group, "HDF5 File Format Specification", version 3.0): superblock 0, groups of
//! symbol tables, contiguous arrays and chunks. It has no checksums that could tell of a change.

use super::super::files::zlib;
use super::{Fields, Written, places};

/// An address that is none.
const NONE: u64 = u64::MAX;

/// Types of messages.
const MESSAGES: [u16; 9] = [0x00, 0x01, 0x02, 0x03, 0x08, 0x0b, 0x0c, 0x11, 0xff];

/// A file to which objects are appended.
struct File {
    bytes: Vec<u8>,
}

impl File {
    /// Appends an object at a multiple of eight bytes, and returns its address.
    fn append(&mut self, object: &[u8]) -> u64 {
        self.bytes.resize(self.bytes.len().next_multiple_of(8), 0);
        let address = self.bytes.len() as u64;
        self.bytes.extend(object);
        address
    }

    /// Appends a header of these messages.
    fn header(&mut self, f: &mut Fields, messages: &[(u16, Vec<u8>)]) -> u64 {
        let mut body = Vec::new();
        for (kind, contents) in messages {
            let mut contents = contents.clone();
            contents.resize(contents.len().next_multiple_of(8), 0);
            body.extend(f.choice("the type of a message", *kind, &MESSAGES).to_le_bytes());
            let length = f.number("the length of a message", contents.len() as u64);
            body.extend((length as u16).to_le_bytes());
            body.extend([f.choice("the flags of a message", 0, &[1, 2, 255]), 0, 0, 0]);
            body.extend(f.part("a message", contents));
        }
        let mut head = vec![f.choice("the version of a header", 1, &[0, 2, 255]), 0];
        let count = f.number("the number of messages", messages.len() as u64) as u16;
        head.extend(count.to_le_bytes());
        head.extend(1_u32.to_le_bytes());
        head.extend((f.number("the length of a header", body.len() as u64) as u32).to_le_bytes());
        head.extend([0; 4]);
        self.append(&[head, body].concat())
    }

    /// Appends a group of these members, by name.
    fn group(&mut self, f: &mut Fields, mut members: Vec<(&str, u64)>) -> u64 {
        members.sort_unstable();
        let mut names = vec![0; 8];
        let mut entries = f.text("the magic of a symbol node", "SNOD").into_bytes();
        entries.extend([f.choice("the version of a symbol node", 1, &[0, 2]), 0]);
        let count = f.number("the number of symbols", members.len() as u64) as u16;
        entries.extend(count.to_le_bytes());
        let mut last = 0;
        for (name, header) in &members {
            last = names.len() as u64;
            entries.extend(f.number("the offset of a name", last).to_le_bytes());
            entries.extend(f.number("the address of a header", *header).to_le_bytes());
            entries.extend([0; 24]);
            names.extend(f.text("a name", name).into_bytes());
            names.push(0);
            names.resize(names.len().next_multiple_of(8), 0);
        }
        // Room for twice the number of symbols of a leaf, 4.
        entries.resize(8 + 8 * 40, 0);
        let entries = self.append(&entries);

        let length = names.len() as u64;
        let data = self.append(&names);
        let mut heap = f.text("the magic of a heap", "HEAP").into_bytes();
        heap.extend([f.choice("the version of a heap", 0, &[1, 255]), 0, 0, 0]);
        heap.extend(f.number("the length of a heap", length).to_le_bytes());
        heap.extend(f.number("the free list of a heap", 1).to_le_bytes());
        heap.extend(f.number("the address of names", data).to_le_bytes());
        let heap = self.append(&heap);

        let keys = [(0_u64.to_le_bytes().to_vec(), entries), (last.to_le_bytes().to_vec(), NONE)];
        let tree = self.tree(f, 0, &keys, 16);
        let table = [
            f.number("the address of a tree", tree).to_le_bytes(),
            f.number("the address of a heap", heap).to_le_bytes(),
        ];
        self.header(f, &[(0x11, table.concat())])
    }

    /// Appends a tree of one node; the last key has no child.
    fn tree(&mut self, f: &mut Fields, kind: u8, keys: &[(Vec<u8>, u64)], rank: usize) -> u64 {
        let children = keys.len() - 1;
        let mut node = f.text("the magic of a tree", "TREE").into_bytes();
        node.push(f.choice("the kind of a tree", kind, &[0, 1, 2, 255]));
        node.push(f.choice("the level of a tree", 0, &[1, 2, 255]));
        let count = f.number("the number of children", children as u64) as u16;
        node.extend(count.to_le_bytes());
        node.extend([NONE, NONE].map(u64::to_le_bytes).concat());
        for (i, (key, child)) in keys.iter().enumerate() {
            node.extend(key);
            if i < children {
                node.extend(f.free_number("the address of a child", *child).to_le_bytes());
            }
        }
        let key = keys[0].0.len();
        node.resize(node.len().max(24 + (2 * rank + 1) * key + 2 * rank * 8), 0);
        self.append(&node)
    }

    /// Appends the header of an array.
    fn array(&mut self, f: &mut Fields, shape: &[u64], number: Number, stored: Stored) -> u64 {
        let rank = f.number("the rank of an array", shape.len() as u64) as u8;
        let mut space = vec![f.choice("the version of a shape", 1, &[0, 2, 3]), rank, 0, 0];
        space.extend([0; 4]);
        for &extent in shape {
            space.extend(f.free_number("an extent", extent).to_le_bytes());
        }
        let kind = number.describe(f);
        let fill = vec![f.choice("the version of a fill value", 2, &[0, 1, 3]), 2, 0, 0];
        let mut messages = vec![(0x01, space), (0x03, kind), (0x05, fill)];
        let mut layout = vec![f.choice("the version of a layout", 3, &[0, 1, 2, 4, 5])];
        match stored {
            Stored::Whole { address, length } => {
                layout.push(f.choice("the class of a layout", 1, &[0, 2, 3]));
                layout.extend(f.free_number("the address of an array", address).to_le_bytes());
                layout.extend(f.number("the length of an array", length).to_le_bytes());
            }
            Stored::Chunks { tree, shape } => {
                layout.push(f.choice("the class of a layout", 2, &[0, 1, 3]));
                let rank = f.number("the rank of chunks", shape.len() as u64 + 1) as u8;
                layout.push(rank);
                layout.extend(f.free_number("the address of chunks", tree).to_le_bytes());
                for &extent in &shape {
                    layout.extend((f.free_number("a chunk's extent", extent) as u32).to_le_bytes());
                }
                let size = f.number("the size of a chunk's number", number.size());
                layout.extend((size as u32).to_le_bytes());
                messages.push((0x0b, filters(f, number.size())));
            }
        }
        messages.push((0x08, layout));
        self.header(f, &messages)
    }
}

/// Where the numbers of an array are.
enum Stored {
    Whole { address: u64, length: u64 },
    Chunks { tree: u64, shape: Vec<u64> },
}

/// A type of numbers.
#[derive(Clone, Copy)]
enum Number {
    F32Big,
    F64,
    U64,
}

impl Number {
    fn size(self) -> u64 {
        if matches!(self, Self::F32Big) { 4 } else { 8 }
    }

    fn describe(self, f: &mut Fields) -> Vec<u8> {
        let (class, bits, properties) = match self {
            Self::F32Big => {
                (0x11, [0x21, 31, 0], &[0_u8, 0, 32, 0, 23, 8, 0, 23, 127, 0, 0, 0][..])
            }
            Self::F64 => (0x11, [0x20, 63, 0], &[0_u8, 0, 64, 0, 52, 11, 0, 52, 255, 3, 0, 0][..]),
            Self::U64 => (0x10, [0, 0, 0], &[0_u8, 0, 64, 0][..]),
        };
        // Others are as valid, and the program that reads them has to know their numbers.
        let mut bytes =
            vec![f.free_choice("the class of a type", class, &[0x10, 0x12, 0x16, 0x31])];
        bytes.extend(bits.map(|bit| f.free_number("a bit of a type", bit) as u8));
        bytes.extend((f.number("the size of a number", self.size()) as u32).to_le_bytes());
        let properties = properties.iter();
        bytes.extend(properties.map(|&byte| f.free_number("a type's own", byte.into()) as u8));
        bytes
    }
}

/// Shuffled, then deflated.
fn filters(f: &mut Fields, size: u64) -> Vec<u8> {
    let mut bytes = vec![f.choice("the version of filters", 1, &[0, 2, 3])];
    bytes.push(f.free_number("the number of filters", 2) as u8);
    bytes.extend([0; 6]);
    for (filter, value) in [(2, size), (1, 6)] {
        bytes.extend(f.choice("a filter", filter, &[1_u16, 2, 3, 4, 5, 32000]).to_le_bytes());
        bytes.extend((f.number("the length of a filter's name", 0) as u16).to_le_bytes());
        bytes.extend([0, 0]);
        bytes.extend((f.free_number("the number of a filter's values", 1) as u16).to_le_bytes());
        bytes.extend((f.free_number("a filter's value", value) as u32).to_le_bytes());
        bytes.extend([0; 4]);
    }
    bytes
}

/// The first bytes of all numbers, then the second ones, and so on.
fn shuffle(bytes: &[u8], width: usize) -> Vec<u8> {
    (0..width).flat_map(|byte| bytes.iter().skip(byte).step_by(width).copied()).collect()
}

/// A file whose root is the group that `fill` writes.
fn file(f: &mut Fields, fill: impl FnOnce(&mut Fields, &mut File) -> u64) -> Vec<u8> {
    let mut file = File { bytes: vec![0; 96] };
    let root = fill(f, &mut file);
    let length = file.bytes.len().next_multiple_of(8);
    file.bytes.resize(length, 0);
    let mut head = f.part("the magic", b"\x89HDF\r\n\x1a\n".to_vec());
    head.push(f.choice("the version of the superblock", 0, &[1, 2, 3, 4, 255]));
    head.extend([0, 0, 0, f.choice("the version of shared headers", 0, &[1, 255])]);
    head.extend([(); 2].map(|()| f.choice("the size of offsets or lengths", 8, &[0, 2, 4, 16])));
    head.push(0);
    for (what, value) in [("symbols of a leaf", 4), ("children of a node", 16)] {
        head.extend((f.number(what, value) as u16).to_le_bytes());
    }
    head.extend([0; 4]);
    head.extend(f.number("the base address", 0).to_le_bytes());
    head.extend(NONE.to_le_bytes());
    head.extend(f.number("the end of the file", length as u64).to_le_bytes());
    head.extend(NONE.to_le_bytes());
    head.extend(0_u64.to_le_bytes());
    head.extend(f.number("the address of the root", root).to_le_bytes());
    head.resize(96, 0);
    let bytes = [head, file.bytes.split_off(96)].concat();
    f.cut("the file", bytes)
}

/// As of Gadget: a group of whole arrays.
pub(super) fn contiguous(f: &mut Fields) -> Written {
    let places = places(50);
    let count = places.len() as u64;
    let bytes = file(f, |f, file| {
        let positions: Vec<u8> =
            places.iter().flat_map(|place| place.to_array()).flat_map(f64::to_le_bytes).collect();
        let ids: Vec<u8> = (0..count).flat_map(u64::to_le_bytes).collect();
        let mut whole = |f: &mut Fields, shape: &[u64], number: Number, numbers: &[u8]| {
            let address = file.append(numbers);
            let stored = Stored::Whole { address, length: numbers.len() as u64 };
            file.array(f, shape, number, stored)
        };
        let positions = whole(f, &[count, 3], Number::F64, &positions);
        let ids = whole(f, &[count], Number::U64, &ids);
        let group = file.group(f, vec![("Coordinates", positions), ("ParticleIDs", ids)]);
        file.group(f, vec![("PartType0", group)])
    });
    Written::one("contiguous.h5", bytes, places)
}

/// Columns at the root, in chunks.
pub(super) fn chunked(f: &mut Fields) -> Written {
    const ROWS: usize = 16;
    let places = places(50);
    let count = places.len() as u64;
    let bytes = file(f, |f, file| {
        let columns = ["x", "y", "z"].into_iter().enumerate().map(|(axis, name)| {
            let mut keys = Vec::new();
            for (i, rows) in places.chunks(ROWS).enumerate() {
                let mut numbers: Vec<f32> = rows.iter().map(|p| p.as_vec3()[axis]).collect();
                numbers.resize(ROWS, 0.0);
                let numbers: Vec<u8> = numbers.iter().flat_map(|x| x.to_be_bytes()).collect();
                let chunk = f.part("a chunk", zlib(&shuffle(&numbers, 4)));
                let length = f.number("the length of a chunk", chunk.len() as u64) as u32;
                let mask = f.free_number("the filters of a chunk", 0) as u32;
                let mut key = [length.to_le_bytes(), mask.to_le_bytes()].concat();
                let row = f.number("the row of a chunk", (i * ROWS) as u64);
                key.extend([row, 0].map(u64::to_le_bytes).concat());
                keys.push((key, file.append(&chunk)));
            }
            // The last key ends the rows: HDF5's own library finds a chunk between its key and the next.
            let end = (places.len().div_ceil(ROWS) * ROWS) as u64;
            keys.push(([0, end, 0].map(u64::to_le_bytes).concat(), NONE));
            let tree = file.tree(f, 1, &keys, 32);
            let stored = Stored::Chunks { tree, shape: vec![ROWS as u64] };
            (name, file.array(f, &[count], Number::F32Big, stored))
        });
        let columns = columns.collect();
        file.group(f, columns)
    });
    Written::one("chunked.h5", bytes, places)
}
