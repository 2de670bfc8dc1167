//! Programs, models and runs.

use crate::failure::{code, free, handle, owned, text};
use crate::posterior::PcadPosterior;
use pcadlang::{Model, Program, RunOptions, Value};
use pcadlang_library::scene::ImageValue;
use pcadlang_scene::vision::Photo;
use std::ffi::c_char;
use std::time::Duration;

/// A program with its parameters and data, before it is compiled.
pub struct PcadProgram(Program);

/// A compiled program.
pub struct PcadModel(Model);

/// How chains are run; a zero is the default.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct PcadOptions {
    /// The seed: the same seed and steps give the same draws, on any number of threads.
    pub seed: u64,
    /// The number of chains; 4 by default.
    pub chains: u32,
    /// The number of threads; all of the machine's by default.
    pub threads: u32,
    /// Kernel applications a chain after warm-up, in place of the program's.
    pub steps: u64,
    /// Kernel applications a chain in warm-up, in place of the program's.
    pub warmup: u64,
    /// The time limit of the run in seconds; none by default.
    pub seconds: f64,
}

/// Opens a program by its path; the shipped ones, such as "lathe.pcad", are found in any folder.
///
/// # Safety
/// `path` is null or ends with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pcad_open(path: *const c_char) -> *mut PcadProgram {
    owned(|| {
        // SAFETY: the caller's promise.
        let path = unsafe { text("the path", path) }?;
        Program::open(path).map(PcadProgram).map_err(|e| e.to_string())
    })
}

/// Parses a program from its text. It can include shipped programs, and reads no files.
///
/// # Safety
/// `source` is null or ends with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pcad_parse(source: *const c_char) -> *mut PcadProgram {
    owned(|| {
        // SAFETY: the caller's promise.
        let source = unsafe { text("the text", source) }?;
        Program::parse(source).map(PcadProgram).map_err(|e| e.to_string())
    })
}

/// Changes a program.
///
/// # Safety
/// `program` is null or a program of this library that no other thread uses.
unsafe fn change(
    program: *mut PcadProgram,
    to: impl FnOnce(Program) -> Result<Program, String>,
) -> i32 {
    code(|| {
        // SAFETY: the caller's promise.
        let program = unsafe { program.as_mut() }.ok_or("the program is null")?;
        program.0 = to(program.0.clone())?;
        Ok(())
    })
}

/// Sets a parameter to a value written as in a program. Returns 0, or -1 for an error.
///
/// # Safety
/// `program` is null or a program of this library that no other thread uses; the texts are null or
/// end with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pcad_set(
    program: *mut PcadProgram,
    name: *const c_char,
    value: *const c_char,
) -> i32 {
    // SAFETY: the caller's promise.
    unsafe { change(program, |p| Ok(p.set(text("the name", name)?, text("the value", value)?))) }
}

/// Gives a data item a number.
///
/// # Safety
/// As `pcad_set`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pcad_observe_number(
    program: *mut PcadProgram,
    name: *const c_char,
    value: f64,
) -> i32 {
    // SAFETY: the caller's promise.
    unsafe { change(program, |p| Ok(p.observe(text("the name", name)?, Value::Num(value)))) }
}

/// Gives a data item an array of numbers, which is copied.
///
/// # Safety
/// As `pcad_set`; `values` is null or points to `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pcad_observe_array(
    program: *mut PcadProgram,
    name: *const c_char,
    values: *const f64,
    count: usize,
) -> i32 {
    let observe = |p: Program| {
        // SAFETY: the caller's promise.
        let (name, values) = unsafe { (text("the name", name)?, slice(values, count)?) };
        Ok(p.observe(name, Value::array(values)))
    };
    // SAFETY: the caller's promise.
    unsafe { change(program, observe) }
}

/// Reads a file for a data item, as its declared kind: an image, a table, keypoints.
///
/// # Safety
/// As `pcad_set`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pcad_observe_file(
    program: *mut PcadProgram,
    name: *const c_char,
    path: *const c_char,
) -> i32 {
    let observe = |p: Program| {
        // SAFETY: the caller's promise.
        let (name, path) = unsafe { (text("the name", name)?, text("the path", path)?) };
        p.observe_file(name, path).map_err(|e| e.to_string())
    };
    // SAFETY: the caller's promise.
    unsafe { change(program, observe) }
}

/// Gives an image item a photograph: red, green and blue of each pixel, row by row from the top,
/// which are copied.
///
/// # Safety
/// As `pcad_set`; `rgb` is null or points to 3 * `width` * `height` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pcad_observe_pixels(
    program: *mut PcadProgram,
    name: *const c_char,
    rgb: *const u8,
    width: u32,
    height: u32,
) -> i32 {
    let observe = |p: Program| {
        let count = (width as usize).checked_mul(height as usize).and_then(|n| n.checked_mul(3));
        let count = count.ok_or("the picture is too large")?;
        // SAFETY: the caller's promise.
        let (name, rgb) = unsafe { (text("the name", name)?, slice(rgb, count)?) };
        let picture = image::RgbImage::from_raw(width, height, rgb.to_vec());
        let picture = picture.ok_or("the picture is too large")?;
        let photo = Photo::from_rgb(picture).map_err(|e| e.to_string())?;
        Ok(p.observe(name, Value::object(ImageValue::photo(photo))))
    };
    // SAFETY: the caller's promise.
    unsafe { change(program, observe) }
}

/// Reads an array.
///
/// # Safety
/// It is null, or points to `count` elements.
unsafe fn slice<'a, T>(values: *const T, count: usize) -> Result<&'a [T], String> {
    match (values.is_null(), count) {
        (_, 0) => Ok(&[]),
        (true, _) => Err("the array is null".to_owned()),
        // SAFETY: it is not null, and the caller promises the rest.
        (false, _) => Ok(unsafe { std::slice::from_raw_parts(values, count) }),
    }
}

/// Compiles a program with its data. The program can be changed and compiled again.
///
/// # Safety
/// `program` is null or a program of this library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pcad_compile(program: *const PcadProgram) -> *mut PcadModel {
    owned(|| {
        // SAFETY: the caller's promise.
        let program = unsafe { handle("program", program) }?;
        program.0.clone().compile().map(PcadModel).map_err(|e| e.to_string())
    })
}

/// Runs chains and returns their draws; `options` may be null.
///
/// # Safety
/// `model` is null or a model of this library, `options` null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pcad_sample(
    model: *const PcadModel,
    options: *const PcadOptions,
) -> *mut PcadPosterior {
    owned(|| {
        // SAFETY: the caller's promise.
        let (model, asked) = unsafe { (handle("model", model)?, options.as_ref()) };
        let asked = asked.copied().unwrap_or_default();
        let given = |n: u64| (n > 0).then_some(n);
        let time = match asked.seconds {
            0.0 => None,
            s => Some(Duration::try_from_secs_f64(s).map_err(|e| format!("seconds: {e}"))?),
        };
        let options = RunOptions {
            seed: asked.seed,
            steps: given(asked.steps),
            warmup: given(asked.warmup),
            time,
            ..RunOptions::default()
        };
        let chains = if asked.chains > 0 { asked.chains as usize } else { 4 };
        let machine = || std::thread::available_parallelism().map_or(1, usize::from);
        let threads = if asked.threads > 0 { asked.threads as usize } else { machine() };
        let posterior = model.0.run(&options, chains, threads).map_err(|e| e.to_string())?;
        Ok(PcadPosterior::new(&posterior))
    })
}

/// Gives a program back; null is allowed.
///
/// # Safety
/// `program` is null or a program of this library that is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pcad_program_free(program: *mut PcadProgram) {
    // SAFETY: the caller's promise.
    unsafe { free(program) }
}

/// Gives a model back; null is allowed.
///
/// # Safety
/// `model` is null or a model of this library that is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pcad_model_free(model: *mut PcadModel) {
    // SAFETY: the caller's promise.
    unsafe { free(model) }
}
