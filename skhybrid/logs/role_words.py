"""Words of names of a log's columns, as patterns: quantities, places, and what says that a column is no such value."""

ROOM = (
    r"\b(zone|zn|znt|room|rm|rtemp|indoor|inside|interior|living|bedroom|lounge|space|za|in|int|ctrl|"
    r"thermostat|current|"
    r"ambiente)\b|raum|innen|zimmer|wohn|binnen|kamer|interieur|ruimte|sejour|piece|ambiance|ambiant(?!.*ext)|salon|"
    r"interno|habitacion|internal air|\bt (zon|roo)\b|\bzon t\b|"
    r"intern[ao]\b|soggiorno|stanza|\bsala\b|chambre|wewnetrzn|pokoj|pomieszcz|mistnost|rumtemp|"
    r"rumstemp|romtemp|inomhus|innetemp|indetemp|stuetemp|huone|sisal|sisail|keittio|"
    r"\bbelso|\bszoba|\bic sicak|\boda s"
)
OUT = (
    r"\b(out|oa|osa|oat|amb|ambient|ext|weather|meteo|wetter|drybulb|air ext)\b|outdoor|outside|dry bul|aussen|"
    r"draussen|temperature 2 ?m\b|\bt2m\b|buiten|exter|dehors|estern|umgebung|ambient|"
    r"zewnetrzn|venk[ou]|utomhus|\bute ?temp|udetemp|\bulko|\bkulso|\bdis sicak"
)
OUTDOORS = r"outdoor|outside|aussen|buiten"  # also beside the name of a room or zone
SET = (
    r"wunsch|"
    r"\b(set|setp|sp|stpt|spt|soll|stp|target|wanted|desired|setting)\b|set ?po?i?n?t|set ?temp|sollwert|solltemp|"
    r"consigne|consigna|gewenst|streef|setpunt|instel|ingestel|"
    r"zadan|borvarde|settpunkt|asetus|tavoite|berekend.*(verwarm|koel)"
)
SET_POINT = (
    r"set ?po?i?n?t|\b(sp|spt|stpt|setp)\b|sollwert|consigne|consigna|setpunt|\bset (heat|cool)\b|"
    r"\b(heat|cool)(ing)? set\b|borvarde|settpunkt|asetus|tavoite|"
    r"\b(heat|cool)(ing)? target|\btarget (heat|cool)|berekend.*(verwarm|koel)|"
    r"\bsoll (heizen|kuhlen)\b|\b(heizen|kuhlen) soll\b"
)
# the set-point that the controller follows at the time, and others
IN_FORCE = r"\b(eff|effective|active|actual|current|aktuel|wirksam)"
OF_A_MODE = (
    r"\b(un)?occ(upied)?\b|night|stand ?by|\baway\b|\beco|vacation|frost|\bgel\b|\b(min|max)(imum)?\b|limit|"
    r"[ck]o[mn]fort|nacht|absenk|reduit"
)
ENDS = r"( (temp\w*|deg\w*|[cfk]|set\w*|sp|target))*$"  # of a name, after what tells two set-points apart
LOWER, UPPER = rf"\b(low|lo|lower){ENDS}", rf"\b(high|hi|upper){ENDS}"
OF_WATER_SET = r"boiler|kessel|\bketel|chaudiere|caldaia|caldera|\bcurve\b|heizkurve|stooklijn|opentherm control"
#: air and water of a plant, surfaces and dew points, whose temperatures are no room's
STREAM = (
    r"(?<!wea )\b[sdmre]a ?(t|tmp|temp|sp)\b|\bt ([srm]a|sup|ret|mix)\b|"
    r"(?<!wea )\b([sdmre]a|[el][aw]|(c|h|hh|ch)?w[sr]?)t\b|"
    r"\b((c|h|hh|ch)w[sr]?|ww)\b|discharge|exhaust|extract|\bmixed|leaving|entering|plenum|embedded|\bloop\b|duct t|"
    r"coil t|\bch (set|sp|t)|(zu|ab|fort|misch|um)luft|\b[vr]l\b|soufflage|reprise|\bdepart\b|\bretour|mandata|ripresa|"
    r"ritorno|impulsion|retorno|insufl|aanvoer|inblaas|afvoer|toevoer|zasilan|nawiew|wywiew|powrot|(till?|fran|av)luft|"
    r"framled|fremlob|turtemp|retur(led|lob|temp)|indblaes|udsug|privod|zpatec|heiz(grenz|kurve)|(puffer|speicher)t|"
    r"\bbuffer|tank\b|\bballon|kotl|vody|\b(ecs|acs|cwu|eau|agua|acqua)\b|vattente|vannste|(slab|surface)(?! heat)|"
    r"oberflach|superfic|\bsurf\b|estrich|dalle|taup|dauwp|rosee|rocio|rugiada|orvalho|\brosy|dagg|rosny|wet bul|umido|"
    r"\b(sky|mrt|wb)\b|freeze|strahlungst|stralingst|empfund|gevoel|percep|perceiv|prevu|(meno|paluu)ve[sd]|"
    r"(tulo|poisto|jate)ilma|lattia(?!lamm)|kastepiste"
)
HEAT = (
    r"heat|heiz|erwarm|verwarm|ketel|\bcv\b|chauff|boiler|furnace|radiator|calef|riscald|burner|brenner|\bwmz\b|"
    r"wae?rme|warmte|"
    r"htg|\bhhwv?\b|chaleur|calore?\b|kessel|chaudiere|caldaia|caldera|"
    r"grzew|grzej|grzan|topen|topny|vytap|\bhea\b|cieplo|ciepla\b|varme|aquec|lamm[io]|"
    r"(?<!ulko)(?<!sisa)(?<!huone)lampo(?!til)|patteri|\bfutes|\bisitma"
)
COOL = (
    r"cool|\bcold\b|kuhl|kuehl|kalte|kaelte|koel|climati(?!zz?a[cz])|chill(?!\b)|"
    r"(?<!heat pump )(?<!heatpump )compressor|froid|frio\b|freddo|refrig|raffresc|"
    r"\bac\b(?!.*\bl[123]\b)|air ?con|clg|\bchwv?\b|chlo?a?d[znic]|\bkyl|\bkoling|arrefec|koude|frigor|"
    r"\bcoo\b|jaahdy|viilen"
)
#: what air or water goes in and out of
VESSEL = (
    r"\b(con|cond\w*|eva|evap\w*|coil?s?|hx|exchanger|tank|buffer|storage|panel|collector|duct|pipe|ahu|fcu|hrv|mvhr)\b"
)
TEMPERATURE = (
    r"temp|teplot|homersekl|sicaklik|lampotil|(ulko|sisa|huone)lampo|dry ?bulb|\b(tmp|znt)\b|\boat?\b|\bt\b|\bt\d|"
    r"grad\b|thermostat"
)
STAGE = (
    r"stage|stg|\bcmd\b|command|\brun|runtime|valve|ventil|duty|\bon\b|status|\bstate\b|level|demand|signal|stufe|klep|"
    r"vanne|venttiil|stell(gro|sign|wert)|relay|active|position|percent|modulation|output"
)
READING = r"(temp\w*( set\w*)?) active\b"  # of Trane: the value in force
#: not the temperature of the air now, or not that of all the sun, where there are several
OTHER_THAN_AIR = (
    r"\b(wall|(?<!(?:st|nd|rd|th|er) )floor|ceiling|ground(?! floor)|soil|erdreich|(min|max)(imum)?|24 ?h)\b|"
    r"gedampft|gemittelt|damped|filtered|operativ|radiant|\bglobe\b|simul|\bsim\b|model|calcul|limit|set ?back|absenk|"
    r"(wand|decken|boden)t|vloer|suelo|pavimento|podlog|g[uo]lv|du sol|evap|manifold|\bpanel|\bpipe|exchanger"
)
PART_OF_SUN = (
    r"\b(dni|dhi|gti|poa)\b|dire[ck]?t|dif+us|\b(dir nor|dif hor)|\bsuora|\bhaja|\bbeam\b|clear ?sky|\btilt|incident"
)
#: what may heat and cool
PLANT = r"hvac|\bcvc\b|climatizz?a[cz]|thermal|thermiq|termic|delivered|\bload\b|\b(pac|wp|hp)\b"
METER = (
    r"\b(heat|warmte|energy|energie)? ?meter\b|zae?hler|counter|compteur|contatore|contador|energ|"
    r"(wae?rme|kae?lte)menge"
)
#: what a meter beside that of heat counts
COUNTS = r"\bhours?\b|betriebsst|stundenz|\b(draai)?uren\b|\bheures\b|starts?\b"
SUN = (
    r"\bghi\b|solar|irrad|radiation|strahlung|sonne|zonne|straling|rayonn|soleil|pyrano|zareni|\bsun\b|insolation|"
    r"\b[qgi] ?sol\b|sateily|auringon|radia[cz]|promieniow|naslonecz|stralning|h ?glo ?hor"
)
#: where the sun is and how long it shines, shades, and other radiation
NO_IRRADIANCE = (
    r"elevation|azimut|altitude|zenith|zonneschijn|shine|sonnen(hoh|schein|st(?!r)|auf|unter|schutz)|"
    r"\b(sun|solar) hours|blind|\bshad|infrared|long ?wave|langwell|gegenstr|terrestrial|atmospher|\bnet\b|reflected|"
    r"\buv\b|\bir\b"
)
#: what heats, and may cool
HEAT_PUMP = r"heat ?pump|varmepump|lampopump|wae?rmepumpe|warmtepomp|pompe a chaleur|pompa di calore|bomba de calor"
ELECTRICITY = (
    rf"ele[ck]|\ba(power|energy)\b|sahko|elettr|strom(?!ung)|stroom|{HEAT_PUMP}|\b(pac|wp|hp|ac)\b|air ?con|compressor|"
    r"consum(ption|ed|o)|consom|verbrauch|verbruik|(?<!lammon)kulutus|plug|socket|chiller(?! (load|evap|cool))"
)
DELIVERED = (  # the heat of a heat pump
    r"thermal|thermique|termic|produced|delivered|heat(ing)? (output|production)|(wae?rme|heiz)leistung|warmteafgifte"
)
#: what no model reads
OTHER = (
    r"humid|feucht|vocht|kosteu|\brh\b|co2|(?<!point )(?<!\bsp )(?<!stpt )occup(?!ied .*(\bset|\bsp\b|stpt))|people|"
    r"person|"
    r"batter|rssi|\blux\b|illumin|pressure|druck|dew|wind|rain|regen|\bfan\b(?! coil)|"
    r"(?<!heat)(?<!heat )(?<!varme)pump\b|return|"
    r"supply(?! air (total|sensible) (heat|cool)ing)|"
    r"(?<!heat )(?<!hea )(?<!\bq )\bflow\b|\bhea por|\bflow temp|vorlauf|rue?cklauf|inlet|outlet|water|wasser|truth|"
    r"number|\bid$|price|mode\b|event|program|motion|\bdoors?\b|noise|forecast|\bdhw\b|hot tap|alarm|enable|season|"
    r"\bcosts?\b|degree ?(day|hour)|\bindex\b|\b(s?cop|eer|jaz)\b|offset|deviation|differen|\bd(elta| ?t)\b|"
    r"calibration|\bstd(ev)?\b|varian|\bvar\b|temp\w* count\b|dead ?band|\berror\b|\bbias\b|hysteres|throttl|\breset|"
    r"lock ?out|economi[sz]er|change ?over t|not met|predict|\bpred\b|estimat|modell?ed|baseline|expected|\bdesign\b|"
    r"auslegung|signature|(lights?|equipment|internal) ((total|convective|radiant|sensible|visible|lost) )+heat|latent|"
    r"heat ?(balance|reject)|condenser heat trans|part load|immersion|system node|\bk w ton\b|"
    r"\bpv\b|photovolt|solar (power|energy|prod|yield|therm|collector|heat(?! flux))|inverter|\bgrid\b|\bev\b|charger|"
    r"dishwash|washing|dryer|freezer|fridge|\bcpu\b"
    r"|previs|vorhersage|prognos|verwacht|wet ?bulb|feuchtkugel|apparent|feels like|gefuhlt|ressenti|wind ?chill|"
    r"\b(plug|light(ing|s)?|base|it|server|internal|electric(al|ity)?|appliance|equipment) loads?\b|"
    r"\bshift|adjust|verschieb|korrektur|\bheat (gain|loss)|recovery|\bwrg\b|efficien|voltage|kayttove|lammin ?ve|"
    r"ilmanvaih|puhal|valaist|\btuul|sade(maar|\b)|ilmanpaine|lasnaolo"
)
POWER = (
    r"\bkw\b|power|capacity|electricity|elec\b|\bq (hea|coo|flo)|heat (rate|flow)|leistung|vermogen|puissance|teho\b|"
    r"\beffekt"
)
LIMIT = r"\b((?:max|min)(?:imum)?|rated|nominal|limit|nenn\w*|(?:available|[a-z]*) ?capacity)\b"  # of a power
FUEL = r"\b((?:erd)?gas(?:heiz\w*|za\w*|verbr\w*|kessel)?|gazu?|fuel|oil|heizol|therm$)\b"  # or the unit
PULSES = r"\bpulses?\b|impuls(?!ion)"
