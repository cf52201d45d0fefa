//! Sine, exponential and the like, the same to the last bit on every processor.
//!
//! `f64::sin` calls `sin` of the platform's C library, and glibc has two of them, one with fused multiply-add and one
//! without, that differ in the last bit. This crate has these functions under C's names, so that the linker finds them
//! before the C library's: in our code, in nalgebra, in the sampling of noise, and in the C code that finds tags. The
//! functions are those of the crate `libm` (a port of musl's), which adds and multiplies in one stated order.
//!
//! Every program that links this crate uses these functions throughout. armcal-core links it, so all our programs do.
#![no_std]
#![allow(unsafe_code, reason = "no_mangle: two functions of one name would be an error of the linker, not of memory")]

macro_rules! of_one_argument {
    ($($name:ident: $number:ty),* $(,)?) => {
        $(#[unsafe(no_mangle)]
        pub extern "C" fn $name(x: $number) -> $number {
            libm::$name(x)
        })*
    };
}

macro_rules! of_two_arguments {
    ($($name:ident: $number:ty),* $(,)?) => {
        $(#[unsafe(no_mangle)]
        pub extern "C" fn $name(x: $number, y: $number) -> $number {
            libm::$name(x, y)
        })*
    };
}

of_one_argument! {
    sin: f64, cos: f64, tan: f64, asin: f64, acos: f64, atan: f64,
    sinh: f64, cosh: f64, tanh: f64, asinh: f64, acosh: f64, atanh: f64,
    exp: f64, exp2: f64, exp10: f64, expm1: f64,
    log: f64, log2: f64, log10: f64, log1p: f64, cbrt: f64,
    sinf: f32, cosf: f32, tanf: f32, asinf: f32, acosf: f32, atanf: f32,
    sinhf: f32, coshf: f32, tanhf: f32, asinhf: f32, acoshf: f32, atanhf: f32,
    expf: f32, exp2f: f32, exp10f: f32, expm1f: f32,
    logf: f32, log2f: f32, log10f: f32, log1pf: f32, cbrtf: f32,
}

of_two_arguments! {
    pow: f64, atan2: f64, hypot: f64,
    powf: f32, atan2f: f32, hypotf: f32,
}

/// Returns sine and cosine of one angle through pointers: LLVM merges a sine and a cosine of one angle into this call.
#[unsafe(no_mangle)]
pub extern "C" fn sincos(x: f64, sine: &mut f64, cosine: &mut f64) {
    (*sine, *cosine) = libm::sincos(x);
}

/// Single-precision variant of [`sincos`].
#[unsafe(no_mangle)]
pub extern "C" fn sincosf(x: f32, sine: &mut f32, cosine: &mut f32) {
    (*sine, *cosine) = libm::sincosf(x);
}
