" Colours where no language server gives them.
if exists("b:current_syntax") | finish | endif
syntax keyword mechStatement edition use mechanism flexure replaces material process motor param let point ground link links model
syntax keyword mechStatement hinge ball universal slider cylindrical fixed print cycle drive rest trace output target minimize require export
syntax keyword mechStatement rod body load string place mirror allow assert case for variant workspace
syntax keyword mechStatement fatigue hole horn mount plate solid spring stop sweep tolerance
syntax keyword mechClause on to at from by with steps over weight along section axis layer pin into toward as in free and about via drum
syntax keyword mechClause continuous turned scale merging across sharing height gravity moment direction keys linear smooth first second thick clearance deep margin fillet
syntax match mechNumber /\<\d\+\(\.\d\+\)\?\([eE][-+]\?\d\+\)\?\>/ nextgroup=mechUnit skipwhite
syntax match mechUnit /\(\<\(um\|mm\|cm\|m\|rad\|deg\|turn\|mN\|N\|kN\|lbf\|Pa\|kPa\|MPa\|GPa\|g\|kg\|ms\|s\)\>\|µm\|[%°]\)\([*\/]\a\+\)*\(\^-\?\d\)\?/ contained
syntax match mechFunction /\<\w\+\ze(/
syntax region mechString start=/"/ end=/"\|$/
syntax match mechComment /\/\/.*$/
highlight default link mechStatement Statement
highlight default link mechClause Keyword
highlight default link mechNumber Number
highlight default link mechUnit Type
highlight default link mechFunction Function
highlight default link mechString String
highlight default link mechComment Comment
let b:current_syntax = "mech"
