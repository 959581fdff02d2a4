//! Addresses of files, as editors write them, and paths.

use lsp_types::Uri;

/// Absolute path of a `file:` address, with `/`; another address as it is.
pub(super) fn path(uri: &Uri) -> String {
    let text = uri.as_str();
    let Some(rest) = text.strip_prefix("file://") else { return text.into() };
    // A host before the path is of no use here.
    let rest = rest.find('/').and_then(|at| rest.get(at..)).unwrap_or("");
    let mut bytes = Vec::with_capacity(rest.len());
    let mut chars = rest.bytes();
    while let Some(byte) = chars.next() {
        if byte == b'%' {
            let hex: Vec<u8> = chars.by_ref().take(2).collect();
            let value = std::str::from_utf8(&hex).ok().and_then(|h| u8::from_str_radix(h, 16).ok());
            bytes.extend(value);
        } else {
            bytes.push(byte);
        }
    }
    let path = String::from_utf8_lossy(&bytes).into_owned();
    // `/C:/designs` is a path of Windows.
    match path.as_bytes() {
        [b'/', drive, b':', ..] if drive.is_ascii_alphabetic() => path.get(1..).unwrap_or("").into(),
        _ => path,
    }
}

/// Address of an absolute path.
pub(super) fn of(path: &str) -> Option<Uri> {
    let mut text = String::from("file://");
    if !path.starts_with('/') {
        text.push('/');
    }
    for byte in path.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'-' | b'_' | b'.' | b'~' | b':' => {
                text.push(byte as char)
            }
            other => text.push_str(&format!("%{other:02X}")),
        }
    }
    text.parse().ok()
}

#[cfg(test)]
mod tests {
    #[test]
    fn paths_come_back() {
        for path in ["/a/b c/ü%.mech", "/x.mech", "C:/d/e.mech"] {
            assert_eq!(super::path(&super::of(path).unwrap()), path);
        }
    }
}
