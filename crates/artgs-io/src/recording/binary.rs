//! Little-endian binary data.

/// Reads values from bytes, each with its end checked.
#[derive(Clone, Copy)]
pub(super) struct Bytes<'a> {
    data: &'a [u8],
    at: usize,
    /// Values are aligned to their size, counted from the first byte (CDR).
    aligned: bool,
}

/// The data ends inside a value.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ends;

impl<'a> Bytes<'a> {
    pub(super) fn new(data: &'a [u8]) -> Self {
        Self { data, at: 0, aligned: false }
    }

    /// Values are aligned to their size, and strings include their end (CDR).
    pub(super) fn aligned(data: &'a [u8]) -> Self {
        Self { data, at: 0, aligned: true }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.at >= self.data.len()
    }

    /// Number of bytes read.
    pub(super) fn position(&self) -> usize {
        self.at
    }

    /// The next `length` bytes.
    pub(super) fn take(&mut self, length: usize) -> Result<&'a [u8], Ends> {
        let end = self.at.checked_add(length).ok_or(Ends)?;
        let taken = self.data.get(self.at..end).ok_or(Ends)?;
        self.at = end;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Ends> {
        if self.aligned {
            self.at = self.at.next_multiple_of(N);
        }
        self.take(N)?.try_into().map_err(|_| Ends)
    }

    pub(super) fn u8(&mut self) -> Result<u8, Ends> {
        Ok(self.array::<1>()?[0])
    }

    pub(super) fn u16(&mut self) -> Result<u16, Ends> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32, Ends> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn i32(&mut self) -> Result<i32, Ends> {
        self.array().map(i32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64, Ends> {
        self.array().map(u64::from_le_bytes)
    }

    /// A count of things of at least `size` bytes each: no more than the remaining data can hold.
    pub(super) fn count(&mut self, size: usize) -> Result<usize, Ends> {
        let count = usize::try_from(self.u64()?).map_err(|_| Ends)?;
        if count.saturating_mul(size) <= self.data.len() - self.at { Ok(count) } else { Err(Ends) }
    }

    pub(super) fn f32(&mut self) -> Result<f32, Ends> {
        self.array().map(f32::from_le_bytes)
    }

    pub(super) fn f64(&mut self) -> Result<f64, Ends> {
        self.array().map(f64::from_le_bytes)
    }

    pub(super) fn f64s<const N: usize>(&mut self) -> Result<[f64; N], Ends> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64()?;
        }
        Ok(values)
    }

    /// Bytes after their number.
    pub(super) fn block(&mut self) -> Result<&'a [u8], Ends> {
        let length = self.u32()? as usize;
        self.take(length)
    }

    /// Text after its number of bytes.
    pub(super) fn text(&mut self) -> Result<String, Ends> {
        let text = String::from_utf8_lossy(self.block()?);
        Ok(text.trim_end_matches('\0').to_string())
    }

    /// Text that ends with a zero.
    pub(super) fn zero_ended(&mut self) -> Result<String, Ends> {
        let rest = self.data.get(self.at..).ok_or(Ends)?;
        let length = rest.iter().position(|b| *b == 0).ok_or(Ends)?;
        self.at += length + 1;
        Ok(String::from_utf8_lossy(&rest[..length]).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_end_with_the_data() {
        let mut bytes = Bytes::new(&[1, 2, 0, 3, b'a', 0, 9, 9]);
        assert_eq!((bytes.u8().unwrap(), bytes.u16().unwrap(), bytes.u8().unwrap()), (1, 2, 3));
        assert_eq!(bytes.zero_ended().unwrap(), "a");
        assert!(bytes.u32().is_err() && bytes.u16().is_ok() && bytes.is_empty());
        assert!(Bytes::new(&[255; 12]).count(1).is_err() && Bytes::new(&[255; 8]).block().is_err());
    }

    #[test]
    fn aligned_values_skip_padding() {
        let mut bytes = Bytes::aligned(&[7, 0, 0, 0, 2, 0, 0, 0, b'x', 0, 0, 0, 5, 0, 0, 0]);
        assert_eq!((bytes.u8().unwrap(), bytes.text().unwrap().as_str(), bytes.u32().unwrap()), (7, "x", 5));
    }
}
