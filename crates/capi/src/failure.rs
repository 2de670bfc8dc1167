//! The last error of each thread.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// Returns what went wrong in the last call of this thread that failed: for a mistake in a program
/// with the place in its source. The text is valid until the next call of this thread; empty if
/// none failed.
#[unsafe(no_mangle)]
pub extern "C" fn pcad_error() -> *const c_char {
    LAST.with_borrow(|last| last.as_ptr())
}

/// Runs a call. An error, or a panic, is kept for [`pcad_error`], and gives `None`.
pub fn attempt<T>(call: impl FnOnce() -> Result<T, String>) -> Option<T> {
    let said = match catch_unwind(AssertUnwindSafe(call)) {
        Ok(Ok(value)) => return Some(value),
        Ok(Err(said)) => said,
        Err(_) => "an internal error; please report it".to_owned(),
    };
    let text = CString::new(said.replace('\0', "\u{fffd}")).unwrap_or_default();
    LAST.set(text);
    None
}

/// As [`attempt`], with 0 for success and -1 for an error.
pub fn code(call: impl FnOnce() -> Result<(), String>) -> i32 {
    if attempt(call).is_some() { 0 } else { -1 }
}

/// As [`attempt`], with a pointer that belongs to the caller, null for an error.
pub fn owned<T>(call: impl FnOnce() -> Result<T, String>) -> *mut T {
    attempt(call).map_or(std::ptr::null_mut(), |value| Box::into_raw(Box::new(value)))
}

/// Reads a text.
///
/// # Safety
/// It is null, or ends with a zero byte.
pub unsafe fn text<'a>(name: &str, text: *const c_char) -> Result<&'a str, String> {
    if text.is_null() {
        return Err(format!("{name} is null"));
    }
    // SAFETY: it is not null, and the caller promises the rest.
    unsafe { CStr::from_ptr(text) }.to_str().map_err(|_| format!("{name} is not UTF-8"))
}

/// Follows a handle.
///
/// # Safety
/// It is null, or one of this library that was not given back.
pub unsafe fn handle<'a, T>(name: &str, handle: *const T) -> Result<&'a T, String> {
    // SAFETY: the caller promises that it is null or valid.
    unsafe { handle.as_ref() }.ok_or_else(|| format!("the {name} is null"))
}

/// Gives a handle back; null is allowed.
///
/// # Safety
/// It is null, or one of this library that was not given back.
pub unsafe fn free<T>(handle: *mut T) {
    if !handle.is_null() {
        // SAFETY: it came from `owned`, and the caller promises that this is its last use. A panic
        // in a destructor must not reach C.
        let _ = attempt(|| {
            drop(unsafe { Box::from_raw(handle) });
            Ok(())
        });
    }
}
