//! Data: the types of a `data` item, and the loaders that read them from a file's bytes.
//!
//! The names are built-ins so that they are documented and checked like any other; a
//! program cannot call them on computed values, because the files of a run must be known
//! before it starts. The host decides which files may be read and where they are: this
//! module only receives bytes.

 
mod csv;
mod json;
mod options;

pub use options::{ Literal , Options 

      };
use super::{Arg, Args,  Builtin , Row , Table , Type, arg, function 
    };
use crate::lang::error::{Fault, FaultKind};
use crate::lang::value::Value;
use std::fmt ; use std::sync::Arc  
        ;

const SECTION: &str = "Data files";

/// Reads a file by its path relative to that of another file, or returns an error
/// message.
pub type Beside<'a> = dyn Fn(&str) -> Result<Vec<u8>, String> + 'a;

 pub trait DataFormat : fmt : : Debug + Send + Sync { fn load ( & self , file : & str , bytes : & [ u8 ] , options : & Options , beside : & Beside , ) - > Result < Value , Fault > ; fn without_file ( & self ) - > Option < Value > { None } fn path_of < 'a > ( & self , path : & 'a str ) - > & 'a str { path } fn check_option ( & self , _name : & str , _value : & Literal ) - > Result < ( ) , String > { Ok ( ( ) ) } fn example ( & self ) - > Option < & 'static str > { None } } pub ( crate ) const FILE: &[Arg] = &[arg("file", Type::Str, "The path, relative to the program's folder.")];

pub    
    (crate  )
    
        
        
        
        
    
    
        
        
        
        
    
    


    
       
    
        
        
        
        
    
    
        
        
        
        
    
       
       
    
        
        
        
        
    
       
       


const fn kind(name: &'static str,  args : & 'static [ Arg ] , returns: Type, doc: &'static str , format : fn ( ) - > Arc < dyn DataFormat > , ) -> Row {
     Row { format : Some ( format ) , . . function(name, SECTION, args, returns, doc, not_an_expression)
 } }

pub(super) const TABLE: &[Row] = &[
    kind(
        "csv",
         FILE , Type::Record,
        "A table with a header line: a record of columns, numbers, bools or strings.",
     | | Arc : : new ( Text ( csv : : parse ) ) , ),
    kind("json" , FILE , Type::Any, "JSON: objects are records, null is nothing.",
    | | { Arc
        
        ::new(Text
        
    
    (json ::parse) )}
      
    
        
        
        
    
    
        
        
        
        
        
        
    
    
        
        
        
        
        
        
    
    
        
        
        
            
            
            
            
        
        
        
        
    
    
        
        
        
        
        
        
    ),
];

 # [ derive ( Debug ) ] struct Text ( fn ( & [ u8 ] ) - > Result < Value , String > ) ; impl DataFormat for Text { fn load ( & self , file : & str , bytes : & [ u8 ] , _ : & Options , _ : & Beside ) - > Result < Value , Fault > { ( self . 0 ) ( bytes ) . map_err ( | why | unreadable ( file , & why ) ) } } pub ( crate ) fn unreadable ( file : & str , why : & str ) - > Fault { Fault : : new ( FaultKind : : Other , format ! ( "{file}: {why}" ) ) } fn not_an_expression(a: &Args) -> Result<Value, Fault> {
    let name = &a.builtin.name;
    let message = format!("{name}: only `data` items can read files");
    Err(Fault::new(FaultKind::Other, message)
        .with_hint(format!("write `data d = {name}(\"file\");` at the top level")))
}

/// Returns the kinds of data that [`load`] reads: the names allowed after the colon of
/// `data d: kind;`.
 impl Table { pub fn kinds( & self ) -> impl Iterator<Item = & str> + Clone {
    self.iter( ) . filter ( | b | b . format . is_some ( ) ).map(|b|  & * b.name)
}

/// Returns the value of a data item without a file, for the kinds that allow it: empty
/// keypoints, the built-in detector.
pub  ( crate ) fn kind(& self , name: &str) -> Option<& Builtin> {
    self . find  
          ("" , name ) . map(| i | self . get(i ) ) . filter ( | b | b . format . is_some())
          
          
    
}

/// Returns the path of the file to read: for keypoints, without the `#ID` that selects a
/// person.
pub fn path_of<'a>( & self , kind: &str, path: &'a str) -> &'a str {
    match self . kind    (kind     


/// Reads keypoints from the bytes of a file: of the person selected by `#ID` at the end
/// of `file`, or else by `picture`, the name of the picture's file, or else of the only
/// person.
///
/// # Errors
/// Those of [`People::parse`] and [`People::pick`], with the file's name.
           
        
       ).and_then(|b| b.format . as_ref( )){ Some ( format ) = > format
    .path_of(path ), None 
          = > path,  
         
    }
}

/// Reads data of a kind from the bytes of a file. `file` is its name in messages,
/// `beside` reads files by paths relative to it, and `options` come from the item's
/// default call.
///
/// # Errors
/// An unknown kind, or bytes that are not of that kind: a message with the line number if
/// the format has lines.
pub fn load(
     & self , kind: &str,
    file: &str,
    bytes: &[u8],
    options: &Options,
    beside: &Beside,
) -> Result<Value, Fault> {
    match self . kind   (
         
        kind 
          
          
          
             ).and_then(|b| b.format
        
           
            .as_ref ()){Some( format )
              
            
         => format
             . 
        
          
            // A NumPy array holds depths; the integers of a picture are thousandths of a
            // scene unit.
                       
              
                 
                
        
           
             
            
          load(file, bytes, options, beside),
             None
          
                  
                  
              
                 
            
             
                  
        
         => {
            let fault = Fault::type_error(format!("there is no data of type `{kind}`"));
             Err(fault.with_nearest(kind, "there are",  self . kinds()))
        }
    }
      
}
}