<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE TS>
<TS version="2.1" language="de">
<context>
    <name>ColumnHelp</name>
    <message>
        <source>stated</source>
        <translation>angegebener</translation>
    </message>
    <message>
        <source>estimated</source>
        <translation>geschätzter</translation>
    </message>
    <message>
        <source>combined</source>
        <translation>verbundener</translation>
    </message>
    <message>
        <source>east</source>
        <translation>Ost</translation>
    </message>
    <message>
        <source>north</source>
        <translation>Nord</translation>
    </message>
    <message>
        <source>up</source>
        <translation>oben</translation>
    </message>
    <message>
        <source>run of images</source>
        <translation>Fahrt mit Bildern</translation>
    </message>
    <message>
        <source>variant of the options; empty: the first results</source>
        <translation>Variante der Optionen; leer: die ersten Ergebnisse</translation>
    </message>
    <message>
        <source>station at which the panorama was taken</source>
        <translation>Station, an der das Panorama aufgenommen wurde</translation>
    </message>
    <message>
        <source>panorama, photo or photo set</source>
        <translation>Panorama, Foto oder Fotosatz</translation>
    </message>
    <message>
        <source>photo of the set</source>
        <translation>Foto des Satzes</translation>
    </message>
    <message>
        <source>rectilinear view of the panorama, or photo of a set</source>
        <translation>geradlinige Ansicht des Panoramas oder Foto eines Satzes</translation>
    </message>
    <message>
        <source>image of the run</source>
        <translation>Bild der Fahrt</translation>
    </message>
    <message>
        <source>camera of the run, as camchain.yaml names it</source>
        <translation>Kamera der Fahrt, wie sie in camchain.yaml heißt</translation>
    </message>
    <message>
        <source>time of the image on the run&apos;s own clock, seconds</source>
        <translation>Zeit des Bildes nach der Uhr der Fahrt, Sekunden</translation>
    </message>
    <message>
        <source>number of the tag</source>
        <translation>Nummer der Marke</translation>
    </message>
    <message>
        <source>family of the tag</source>
        <translation>Familie der Marke</translation>
    </message>
    <message>
        <source>surveyed point</source>
        <translation>eingemessener Punkt</translation>
    </message>
    <message>
        <source>control: may hold the map; check: is only compared</source>
        <translation>control: darf die Karte halten; check: wird nur verglichen</translation>
    </message>
    <message>
        <source>state of the row, in one word</source>
        <translation>Zustand der Zeile, in einem Wort</translation>
    </message>
    <message>
        <source>why there is no value</source>
        <translation>warum es keinen Wert gibt</translation>
    </message>
    <message>
        <source>program whose poses are compared</source>
        <translation>Programm, dessen Posen verglichen werden</translation>
    </message>
    <message>
        <source>images that show it or belong to it</source>
        <translation>Bilder, die es zeigen oder dazugehören</translation>
    </message>
    <message>
        <source>runs that show or localized it</source>
        <translation>Fahrten, die es zeigen oder lokalisiert haben</translation>
    </message>
    <message>
        <source>tags that are seen</source>
        <translation>Marken, die gesehen werden</translation>
    </message>
    <message>
        <source>the best comes first</source>
        <translation>das Beste steht vorn</translation>
    </message>
    <message>
        <source>what is proposed or compared</source>
        <translation>was vorgeschlagen oder verglichen wird</translation>
    </message>
    <message>
        <source>position, x</source>
        <translation>Position, x</translation>
    </message>
    <message>
        <source>position, y</source>
        <translation>Position, y</translation>
    </message>
    <message>
        <source>position, z</source>
        <translation>Position, z</translation>
    </message>
    <message>
        <source>position in the rig: right of its origin</source>
        <translation>Position im Kamerasystem: rechts von seinem Ursprung</translation>
    </message>
    <message>
        <source>position in the rig: below its origin</source>
        <translation>Position im Kamerasystem: unter seinem Ursprung</translation>
    </message>
    <message>
        <source>position in the rig: in front of its origin</source>
        <translation>Position im Kamerasystem: vor seinem Ursprung</translation>
    </message>
    <message>
        <source>position in the run&apos;s own frame (odom), x</source>
        <translation>Position im System der Fahrt (odom), x</translation>
    </message>
    <message>
        <source>position in the run&apos;s own frame (odom), y</source>
        <translation>Position im System der Fahrt (odom), y</translation>
    </message>
    <message>
        <source>position in the run&apos;s own frame (odom), z</source>
        <translation>Position im System der Fahrt (odom), z</translation>
    </message>
    <message>
        <source>latitude on WGS 84</source>
        <translation>Breite in WGS 84</translation>
    </message>
    <message>
        <source>longitude on WGS 84</source>
        <translation>Länge in WGS 84</translation>
    </message>
    <message>
        <source>height above the WGS 84 ellipsoid</source>
        <translation>Höhe über dem Ellipsoid von WGS 84</translation>
    </message>
    <message>
        <source>easting in the project&apos;s coordinate system</source>
        <translation>Rechtswert im Koordinatensystem des Projekts</translation>
    </message>
    <message>
        <source>northing in the project&apos;s coordinate system</source>
        <translation>Hochwert im Koordinatensystem des Projekts</translation>
    </message>
    <message>
        <source>direction of the optical axis or of a panorama&apos;s image centre, clockwise from true north</source>
        <translation>Richtung der optischen Achse oder der Bildmitte eines Panoramas, im Uhrzeigersinn ab geographisch Nord</translation>
    </message>
    <message>
        <source>angle of the optical axis above the horizon</source>
        <translation>Winkel der optischen Achse über dem Horizont</translation>
    </message>
    <message>
        <source>roll, clockwise as seen from behind the camera</source>
        <translation>Rollwinkel, im Uhrzeigersinn von hinter der Kamera gesehen</translation>
    </message>
    <message>
        <source>1 sigma of the heading</source>
        <translation>1 Sigma der Richtung</translation>
    </message>
    <message>
        <source>1 sigma of the pitch</source>
        <translation>1 Sigma der Neigung</translation>
    </message>
    <message>
        <source>1 sigma of the roll</source>
        <translation>1 Sigma des Rollwinkels</translation>
    </message>
    <message>
        <source>1 sigma to the east</source>
        <translation>1 Sigma nach Osten</translation>
    </message>
    <message>
        <source>1 sigma to the north</source>
        <translation>1 Sigma nach Norden</translation>
    </message>
    <message>
        <source>1 sigma upwards</source>
        <translation>1 Sigma nach oben</translation>
    </message>
    <message>
        <source>1 sigma of the rotation about the axis x of the frame</source>
        <translation>1 Sigma der Drehung um die x-Achse des Systems</translation>
    </message>
    <message>
        <source>1 sigma of the rotation about the tag&apos;s own axis x</source>
        <translation>1 Sigma der Drehung um die eigene x-Achse der Marke</translation>
    </message>
    <message>
        <source>1 sigma of the rotation about the axis y of the frame</source>
        <translation>1 Sigma der Drehung um die y-Achse des Systems</translation>
    </message>
    <message>
        <source>1 sigma of the rotation about the tag&apos;s own axis y</source>
        <translation>1 Sigma der Drehung um die eigene y-Achse der Marke</translation>
    </message>
    <message>
        <source>1 sigma of the rotation about the axis z of the frame</source>
        <translation>1 Sigma der Drehung um die z-Achse des Systems</translation>
    </message>
    <message>
        <source>1 sigma of the rotation about the tag&apos;s own axis z</source>
        <translation>1 Sigma der Drehung um die eigene z-Achse der Marke</translation>
    </message>
    <message>
        <source>panorama (G2): one answer for the whole panorama; view (G1): one for each rectilinear view</source>
        <translation>Panorama (G2): eine Antwort für das ganze Panorama; Ansicht (G1): je eine für jede geradlinige Ansicht</translation>
    </message>
    <message>
        <source>ground truth that the answer is compared with: self (the run&apos;s own tags), control (surveyed points), survey (the tag map), or a release</source>
        <translation>Referenz, mit der die Antwort verglichen wird: self (die Marken der Fahrt selbst), control (eingemessene Punkte), survey (die Markenkarte) oder eine Veröffentlichung</translation>
    </message>
    <message>
        <source>relative: in the run&apos;s own frame; absolute: in the site&apos;s frame</source>
        <translation>relative: im System der Fahrt; absolute: im System des Messgebiets</translation>
    </message>
    <message>
        <source>localized, rejected or unmatched; no_reference, missing: there is nothing to compare</source>
        <translation>localized (lokalisiert), rejected (abgelehnt) oder unmatched (nicht zugeordnet); no_reference, missing: es gibt nichts zu vergleichen</translation>
    </message>
    <message>
        <source>distance in space between the answer and the reference</source>
        <translation>räumlicher Abstand zwischen der Antwort und der Referenz</translation>
    </message>
    <message>
        <source>horizontal distance between the answer and the reference</source>
        <translation>waagerechter Abstand zwischen der Antwort und der Referenz</translation>
    </message>
    <message>
        <source>difference in height between the answer and the reference, without sign</source>
        <translation>Höhenunterschied zwischen der Antwort und der Referenz, ohne Vorzeichen</translation>
    </message>
    <message>
        <source>difference to the east: answer minus reference</source>
        <translation>Differenz nach Osten: Antwort minus Referenz</translation>
    </message>
    <message>
        <source>difference to the north: answer minus reference</source>
        <translation>Differenz nach Norden: Antwort minus Referenz</translation>
    </message>
    <message>
        <source>difference upwards: answer minus reference</source>
        <translation>Differenz nach oben: Antwort minus Referenz</translation>
    </message>
    <message>
        <source>angle between the rotations of the answer and the reference</source>
        <translation>Winkel zwischen den Drehungen der Antwort und der Referenz</translation>
    </message>
    <message>
        <source>1 sigma of the difference to the east, the ground truth&apos;s included</source>
        <translation>1 Sigma der Differenz nach Osten, das der Referenz eingeschlossen</translation>
    </message>
    <message>
        <source>1 sigma of the difference to the north, the ground truth&apos;s included</source>
        <translation>1 Sigma der Differenz nach Norden, das der Referenz eingeschlossen</translation>
    </message>
    <message>
        <source>1 sigma of the difference upwards, the ground truth&apos;s included</source>
        <translation>1 Sigma der Differenz nach oben, das der Referenz eingeschlossen</translation>
    </message>
    <message>
        <source>1 sigma of the rotation, root mean square of the axes</source>
        <translation>1 Sigma der Drehung, quadratisches Mittel der Achsen</translation>
    </message>
    <message>
        <source>squared error over its stated covariance; about dof if the sigmas are right</source>
        <translation>quadrierter Fehler in Einheiten der angegebenen Kovarianz; etwa dof, wenn die Sigmas stimmen</translation>
    </message>
    <message>
        <source>squared horizontal error over its covariance; about 2 if the sigmas are right</source>
        <translation>quadrierter waagerechter Fehler in Einheiten seiner Kovarianz; etwa 2, wenn die Sigmas stimmen</translation>
    </message>
    <message>
        <source>squared vertical error over its variance; about 1 if the sigmas are right</source>
        <translation>quadrierter Höhenfehler in Einheiten seiner Varianz; etwa 1, wenn die Sigmas stimmen</translation>
    </message>
    <message>
        <source>degrees of freedom of nees</source>
        <translation>Freiheitsgrade von nees</translation>
    </message>
    <message>
        <source>part of the 1 sigma in space that comes from the tag map</source>
        <translation>Anteil am räumlichen 1 Sigma, der von der Markenkarte kommt</translation>
    </message>
    <message>
        <source>part of the 1 sigma in space that comes from the offset between station and tag</source>
        <translation>Anteil am räumlichen 1 Sigma, der vom Abstand zwischen Station und Marke kommt</translation>
    </message>
    <message>
        <source>part of the 1 sigma in space that comes from stitching</source>
        <translation>Anteil am räumlichen 1 Sigma, der vom Zusammensetzen kommt</translation>
    </message>
    <message>
        <source>part of the 1 sigma in space that comes from localization</source>
        <translation>Anteil am räumlichen 1 Sigma, der von der Lokalisierung kommt</translation>
    </message>
    <message>
        <source>the largest part of the 1 sigma</source>
        <translation>der größte Anteil am 1 Sigma</translation>
    </message>
    <message>
        <source>parallax of the points around the panorama (within 30 m), median</source>
        <translation>Parallaxe der Punkte um das Panorama (bis 30 m), Median</translation>
    </message>
    <message>
        <source>distance of the points around the panorama (within 30 m), median</source>
        <translation>Entfernung der Punkte um das Panorama (bis 30 m), Median</translation>
    </message>
    <message>
        <source>distance over parallax times 1 mrad, median of the points around the panorama</source>
        <translation>Entfernung durch Parallaxe mal 1 mrad, Median der Punkte um das Panorama</translation>
    </message>
    <message>
        <source>whether depth_sigma_m keeps the limit trust_depth_sigma_m</source>
        <translation>ob depth_sigma_m die Grenze trust_depth_sigma_m einhält</translation>
    </message>
    <message>
        <source>1: answer and reference depend on the same data: agreement, not accuracy</source>
        <translation>1: Antwort und Referenz hängen von denselben Daten ab: Übereinstimmung, keine Genauigkeit</translation>
    </message>
    <message>
        <source>whether the row is an attempt: the reference has the station&apos;s position</source>
        <translation>ob die Zeile als Versuch zählt: die Referenz hat die Position der Station</translation>
    </message>
    <message>
        <source>error in space</source>
        <translation>räumlicher Fehler</translation>
    </message>
    <message>
        <source>share of the attempts with at most this error</source>
        <translation>Anteil der Versuche mit höchstens diesem Fehler</translation>
    </message>
    <message>
        <source>lower limit of the share&apos;s confidence band</source>
        <translation>untere Grenze des Vertrauensbereichs des Anteils</translation>
    </message>
    <message>
        <source>upper limit of the share&apos;s confidence band</source>
        <translation>obere Grenze des Vertrauensbereichs des Anteils</translation>
    </message>
    <message>
        <source>share of the answers that are used, the best supported depth first</source>
        <translation>Anteil der verwendeten Antworten, die am besten gestützte Tiefe zuerst</translation>
    </message>
    <message>
        <source>median of the errors in space</source>
        <translation>Median der räumlichen Fehler</translation>
    </message>
    <message>
        <source>90th percentile of the errors in space</source>
        <translation>90. Perzentil der räumlichen Fehler</translation>
    </message>
    <message>
        <source>largest error in space</source>
        <translation>größter räumlicher Fehler</translation>
    </message>
    <message>
        <source>how the reference pose is determined: tags, bridged or none</source>
        <translation>woraus die Referenzpose bestimmt ist: tags (Marken), bridged (überbrückt) oder none (keine)</translation>
    </message>
    <message>
        <source>1 sigma of the estimate to the east, as it states it</source>
        <translation>1 Sigma der Schätzung nach Osten, wie sie es angibt</translation>
    </message>
    <message>
        <source>1 sigma of the estimate to the north, as it states it</source>
        <translation>1 Sigma der Schätzung nach Norden, wie sie es angibt</translation>
    </message>
    <message>
        <source>1 sigma of the estimate upwards, as it states it</source>
        <translation>1 Sigma der Schätzung nach oben, wie sie es angibt</translation>
    </message>
    <message>
        <source>difference to the east: estimate minus reference</source>
        <translation>Differenz nach Osten: Schätzung minus Referenz</translation>
    </message>
    <message>
        <source>difference to the north: estimate minus reference</source>
        <translation>Differenz nach Norden: Schätzung minus Referenz</translation>
    </message>
    <message>
        <source>difference upwards: estimate minus reference</source>
        <translation>Differenz nach oben: Schätzung minus Referenz</translation>
    </message>
    <message>
        <source>1 sigma of the reference to the east</source>
        <translation>1 Sigma der Referenz nach Osten</translation>
    </message>
    <message>
        <source>1 sigma of the reference to the north</source>
        <translation>1 Sigma der Referenz nach Norden</translation>
    </message>
    <message>
        <source>1 sigma of the reference upwards</source>
        <translation>1 Sigma der Referenz nach oben</translation>
    </message>
    <message>
        <source>path since the last image with a tag, over which the run&apos;s motion leads</source>
        <translation>Weg seit dem letzten Bild mit einer Marke, über den die Bewegung der Fahrt führt</translation>
    </message>
    <message>
        <source>localized, rejected or unmatched</source>
        <translation>localized (lokalisiert), rejected (abgelehnt) oder unmatched (nicht zugeordnet)</translation>
    </message>
    <message>
        <source>matches between the panorama and the run&apos;s images</source>
        <translation>Zuordnungen zwischen dem Panorama und den Bildern der Fahrt</translation>
    </message>
    <message>
        <source>matches that agree with the answer</source>
        <translation>Zuordnungen, die mit der Antwort übereinstimmen</translation>
    </message>
    <message>
        <source>views of the panorama that have such matches</source>
        <translation>Ansichten des Panoramas mit solchen Zuordnungen</translation>
    </message>
    <message>
        <source>difference to the east: geotag minus answer</source>
        <translation>Differenz nach Osten: Geotag minus Antwort</translation>
    </message>
    <message>
        <source>difference to the north: geotag minus answer</source>
        <translation>Differenz nach Norden: Geotag minus Antwort</translation>
    </message>
    <message>
        <source>difference upwards: geotag minus answer</source>
        <translation>Differenz nach oben: Geotag minus Antwort</translation>
    </message>
    <message>
        <source>whether the geotag was used for the run&apos;s position, or contradicts it</source>
        <translation>ob der Geotag für die Lage der Fahrt verwendet wurde oder ihr widerspricht</translation>
    </message>
    <message>
        <source>1 sigma of the position in the run&apos;s own frame (odom), x</source>
        <translation>1 Sigma der Position im System der Fahrt (odom), x</translation>
    </message>
    <message>
        <source>1 sigma of the position in the run&apos;s own frame (odom), y</source>
        <translation>1 Sigma der Position im System der Fahrt (odom), y</translation>
    </message>
    <message>
        <source>1 sigma of the position in the run&apos;s own frame (odom), z</source>
        <translation>1 Sigma der Position im System der Fahrt (odom), z</translation>
    </message>
    <message>
        <source>found points as a share of those that should be seen</source>
        <translation>gefundene Punkte als Anteil derer, die zu sehen sein sollten</translation>
    </message>
    <message>
        <source>distance of the answer from the nearest camera of the run</source>
        <translation>Abstand der Antwort von der nächsten Kamera der Fahrt</translation>
    </message>
    <message>
        <source>pixel in the image, to the right</source>
        <translation>Pixel im Bild, nach rechts</translation>
    </message>
    <message>
        <source>pixel in the image, down</source>
        <translation>Pixel im Bild, nach unten</translation>
    </message>
    <message>
        <source>pixel in the view, to the right</source>
        <translation>Pixel in der Ansicht, nach rechts</translation>
    </message>
    <message>
        <source>pixel in the view, down</source>
        <translation>Pixel in der Ansicht, nach unten</translation>
    </message>
    <message>
        <source>what of the photo&apos;s pose was refined with the run&apos;s points</source>
        <translation>was von der Pose des Fotos mit den Punkten der Fahrt verbessert wurde</translation>
    </message>
    <message>
        <source>bits of the tag&apos;s code that had to be corrected</source>
        <translation>Bits im Code der Marke, die berichtigt werden mussten</translation>
    </message>
    <message>
        <source>decision margin: how clearly the bits of the code are black or white</source>
        <translation>Entscheidungsabstand: wie deutlich die Bits des Codes schwarz oder weiß sind</translation>
    </message>
    <message>
        <source>1 sigma of a coordinate in the picture</source>
        <translation>1 Sigma einer Koordinate im Bild</translation>
    </message>
    <message>
        <source>edge of the tag&apos;s black square</source>
        <translation>Kante des schwarzen Quadrats der Marke</translation>
    </message>
    <message>
        <source>root mean square of the residuals in the pictures</source>
        <translation>quadratisches Mittel der Residuen in den Bildern</translation>
    </message>
    <message>
        <source>ok; weak: too few pictures; ambiguous: two solutions; duplicate: at two places; moved; size: the printed size is contradicted; bent; unsolved</source>
        <translation>ok; weak: zu wenige Bilder; ambiguous: zwei Lösungen; duplicate: an zwei Orten; moved: bewegt; size: der gedruckten Größe wird widersprochen; bent: gewölbt; unsolved: ohne Lösung</translation>
    </message>
    <message>
        <source>used, taken out (contradicts the other control), or not used</source>
        <translation>verwendet, herausgenommen (widerspricht den anderen Passpunkten) oder nicht verwendet</translation>
    </message>
    <message>
        <source>check, or moved: the tag has moved</source>
        <translation>check oder moved: die Marke hat sich bewegt</translation>
    </message>
    <message>
        <source>position as surveyed, x</source>
        <translation>Position laut Einmessung, x</translation>
    </message>
    <message>
        <source>position as surveyed, y</source>
        <translation>Position laut Einmessung, y</translation>
    </message>
    <message>
        <source>position as surveyed, z</source>
        <translation>Position laut Einmessung, z</translation>
    </message>
    <message>
        <source>horizontal 1 sigma of the survey, per axis</source>
        <translation>waagerechtes 1 Sigma der Einmessung, je Achse</translation>
    </message>
    <message>
        <source>vertical 1 sigma of the survey</source>
        <translation>1 Sigma der Höhe der Einmessung</translation>
    </message>
    <message>
        <source>covariance of the differences to the east and to the north</source>
        <translation>Kovarianz der Differenzen nach Osten und nach Norden</translation>
    </message>
    <message>
        <source>size of the residual or difference in its own sigmas</source>
        <translation>Größe des Residuums oder der Differenz in eigenen Sigmas</translation>
    </message>
    <message>
        <source>difference to the east in its own sigmas</source>
        <translation>Differenz nach Osten in eigenen Sigmas</translation>
    </message>
    <message>
        <source>difference to the north in its own sigmas</source>
        <translation>Differenz nach Norden in eigenen Sigmas</translation>
    </message>
    <message>
        <source>difference upwards in its own sigmas</source>
        <translation>Differenz nach oben in eigenen Sigmas</translation>
    </message>
    <message>
        <source>difference to the east if the map were made without the point</source>
        <translation>Differenz nach Osten, wenn die Karte ohne den Punkt entstünde</translation>
    </message>
    <message>
        <source>difference to the north if the map were made without the point</source>
        <translation>Differenz nach Norden, wenn die Karte ohne den Punkt entstünde</translation>
    </message>
    <message>
        <source>difference upwards if the map were made without the point</source>
        <translation>Differenz nach oben, wenn die Karte ohne den Punkt entstünde</translation>
    </message>
    <message>
        <source>1 sigma of left_out_de_m</source>
        <translation>1 Sigma von left_out_de_m</translation>
    </message>
    <message>
        <source>1 sigma of left_out_dn_m</source>
        <translation>1 Sigma von left_out_dn_m</translation>
    </message>
    <message>
        <source>1 sigma of left_out_du_m</source>
        <translation>1 Sigma von left_out_du_m</translation>
    </message>
    <message>
        <source>squared difference over its covariance, of 3 degrees of freedom</source>
        <translation>quadrierte Differenz in Einheiten ihrer Kovarianz, 3 Freiheitsgrade</translation>
    </message>
    <message>
        <source>squared difference of the poses over its covariance, of 6 degrees of freedom</source>
        <translation>quadrierte Differenz der Posen in Einheiten ihrer Kovarianz, 6 Freiheitsgrade</translation>
    </message>
    <message>
        <source>squared residuals of the tag&apos;s 8 coordinates over their variances</source>
        <translation>quadrierte Residuen der 8 Koordinaten der Marke in Einheiten ihrer Varianzen</translation>
    </message>
    <message>
        <source>set-up of the total station</source>
        <translation>Aufstellung des Tachymeters</translation>
    </message>
    <message>
        <source>target of the reading</source>
        <translation>Ziel der Ablesung</translation>
    </message>
    <message>
        <source>direction, zenith angle or slope distance</source>
        <translation>Richtung, Zenitwinkel oder Schrägstrecke</translation>
    </message>
    <message>
        <source>value that was read</source>
        <translation>abgelesener Wert</translation>
    </message>
    <message>
        <source>1 sigma of the reading as stated</source>
        <translation>1 Sigma der Ablesung wie angegeben</translation>
    </message>
    <message>
        <source>value by the map minus value read</source>
        <translation>Wert nach der Karte minus abgelesener Wert</translation>
    </message>
    <message>
        <source>unit of the row&apos;s values</source>
        <translation>Einheit der Werte der Zeile</translation>
    </message>
    <message>
        <source>line of total_station.csv</source>
        <translation>Zeile in total_station.csv</translation>
    </message>
    <message>
        <source>first tag</source>
        <translation>erste Marke</translation>
    </message>
    <message>
        <source>second tag</source>
        <translation>zweite Marke</translation>
    </message>
    <message>
        <source>distance as measured</source>
        <translation>gemessene Strecke</translation>
    </message>
    <message>
        <source>1 sigma of the measured distance as stated</source>
        <translation>1 Sigma der gemessenen Strecke wie angegeben</translation>
    </message>
    <message>
        <source>the distance by the map</source>
        <translation>die Strecke nach der Karte</translation>
    </message>
    <message>
        <source>distance by the map minus measured distance</source>
        <translation>Strecke nach der Karte minus gemessene Strecke</translation>
    </message>
    <message>
        <source>1 sigma of the difference</source>
        <translation>1 Sigma der Differenz</translation>
    </message>
    <message>
        <source>run or photo set</source>
        <translation>Fahrt oder Fotosatz</translation>
    </message>
    <message>
        <source>date of the run</source>
        <translation>Datum der Fahrt</translation>
    </message>
    <message>
        <source>tags in images</source>
        <translation>Marken in Bildern</translation>
    </message>
    <message>
        <source>observations that were left out</source>
        <translation>Beobachtungen, die weggelassen wurden</translation>
    </message>
    <message>
        <source>factor on the stated sigmas of corners</source>
        <translation>Faktor auf die angegebenen Sigmas der Ecken</translation>
    </message>
    <message>
        <source>true length over the length by the odometry</source>
        <translation>wahre Länge durch Länge nach der Odometrie</translation>
    </message>
    <message>
        <source>1 sigma of the scale</source>
        <translation>1 Sigma des Maßstabs</translation>
    </message>
    <message>
        <source>turn of the odometry&apos;s heading for each metre</source>
        <translation>Drehung der Richtung der Odometrie je Meter</translation>
    </message>
    <message>
        <source>1 sigma of the heading&apos;s drift</source>
        <translation>1 Sigma der Drift der Richtung</translation>
    </message>
    <message>
        <source>jumps that were found in the odometry</source>
        <translation>in der Odometrie gefundene Sprünge</translation>
    </message>
    <message>
        <source>root mean square of the tags: the map without this run against the map of all</source>
        <translation>quadratisches Mittel der Marken: die Karte ohne diese Fahrt gegen die Karte aus allen</translation>
    </message>
    <message>
        <source>tags that were compared for it</source>
        <translation>Marken, die dafür verglichen wurden</translation>
    </message>
    <message>
        <source>1 sigma of the tag&apos;s centre in space, three axes in quadrature</source>
        <translation>räumliches 1 Sigma der Mitte der Marke, drei Achsen quadratisch addiert</translation>
    </message>
    <message>
        <source>part of sigma_3d_m that comes from control points</source>
        <translation>Anteil an sigma_3d_m, der von Passpunkten kommt</translation>
    </message>
    <message>
        <source>part of sigma_3d_m that comes from geotags</source>
        <translation>Anteil an sigma_3d_m, der von Geotags kommt</translation>
    </message>
    <message>
        <source>part of sigma_3d_m that comes from GPS</source>
        <translation>Anteil an sigma_3d_m, der von GPS kommt</translation>
    </message>
    <message>
        <source>part of sigma_3d_m that comes from corners of tags and marks</source>
        <translation>Anteil an sigma_3d_m, der von Ecken der Marken und von Markierungen kommt</translation>
    </message>
    <message>
        <source>part of sigma_3d_m that comes from odometry</source>
        <translation>Anteil an sigma_3d_m, der von der Odometrie kommt</translation>
    </message>
    <message>
        <source>part of sigma_3d_m that comes from points of the scene</source>
        <translation>Anteil an sigma_3d_m, der von Punkten der Szene kommt</translation>
    </message>
    <message>
        <source>part of sigma_3d_m that comes from measured distances and total stations</source>
        <translation>Anteil an sigma_3d_m, der von gemessenen Strecken und Tachymetern kommt</translation>
    </message>
    <message>
        <source>part of sigma_3d_m that comes from other assumptions</source>
        <translation>Anteil an sigma_3d_m, der von anderen Annahmen kommt</translation>
    </message>
    <message>
        <source>the largest part of sigma_3d_m</source>
        <translation>der größte Anteil an sigma_3d_m</translation>
    </message>
    <message>
        <source>epoch of the earlier coordinates</source>
        <translation>Epoche der früheren Koordinaten</translation>
    </message>
    <message>
        <source>epoch of the coordinates that are used</source>
        <translation>Epoche der verwendeten Koordinaten</translation>
    </message>
    <message>
        <source>moved (beyond 99.9 %) or same</source>
        <translation>moved (bewegt, über 99,9 %) oder same (gleich)</translation>
    </message>
    <message>
        <source>difference to the east: epoch used minus earlier epoch</source>
        <translation>Differenz nach Osten: verwendete minus frühere Epoche</translation>
    </message>
    <message>
        <source>difference to the north: epoch used minus earlier epoch</source>
        <translation>Differenz nach Norden: verwendete minus frühere Epoche</translation>
    </message>
    <message>
        <source>difference upwards: epoch used minus earlier epoch</source>
        <translation>Differenz nach oben: verwendete minus frühere Epoche</translation>
    </message>
    <message>
        <source>difference to the east: now minus before</source>
        <translation>Differenz nach Osten: jetzt minus vorher</translation>
    </message>
    <message>
        <source>difference to the north: now minus before</source>
        <translation>Differenz nach Norden: jetzt minus vorher</translation>
    </message>
    <message>
        <source>difference upwards: now minus before</source>
        <translation>Differenz nach oben: jetzt minus vorher</translation>
    </message>
    <message>
        <source>angle between the rotations now and before</source>
        <translation>Winkel zwischen den Drehungen jetzt und vorher</translation>
    </message>
    <message>
        <source>agrees, contradicts (beyond 99.9 %) or unseen</source>
        <translation>agrees (stimmt überein), contradicts (widerspricht, über 99,9 %) oder unseen (nicht gesehen)</translation>
    </message>
    <message>
        <source>squared difference of stated and estimated offset over its covariance, 3 degrees of freedom</source>
        <translation>quadrierte Differenz zwischen angegebenem und geschätztem Abstand in Einheiten ihrer Kovarianz, 3 Freiheitsgrade</translation>
    </message>
    <message>
        <source>estimated offset from the tag along the wall, to the right</source>
        <translation>geschätzter Abstand von der Marke entlang der Wand, nach rechts</translation>
    </message>
    <message>
        <source>estimated offset from the tag out of the wall</source>
        <translation>geschätzter Abstand von der Marke aus der Wand heraus</translation>
    </message>
    <message>
        <source>estimated offset from the tag upwards</source>
        <translation>geschätzter Abstand von der Marke nach oben</translation>
    </message>
    <message>
        <source>1 sigma of right_m</source>
        <translation>1 Sigma von right_m</translation>
    </message>
    <message>
        <source>1 sigma of out_m</source>
        <translation>1 Sigma von out_m</translation>
    </message>
    <message>
        <source>1: the station&apos;s own tag is among the tags used</source>
        <translation>1: die Marke der Station selbst ist unter den verwendeten Marken</translation>
    </message>
    <message>
        <source>planned pass along a path</source>
        <translation>geplanter Durchgang entlang eines Weges</translation>
    </message>
    <message>
        <source>passes that see the tag</source>
        <translation>Durchgänge, die die Marke sehen</translation>
    </message>
    <message>
        <source>pictures that reach the wanted sigma; empty: no number does</source>
        <translation>Bilder, mit denen das gewünschte Sigma erreicht wird; leer: mit keiner Anzahl</translation>
    </message>
    <message>
        <source>1 sigma along the long axis of the horizontal ellipse</source>
        <translation>1 Sigma entlang der langen Achse der waagerechten Ellipse</translation>
    </message>
    <message>
        <source>1 sigma along the short axis of the horizontal ellipse</source>
        <translation>1 Sigma entlang der kurzen Achse der waagerechten Ellipse</translation>
    </message>
    <message>
        <source>bearing of the ellipse&apos;s long axis, clockwise from north</source>
        <translation>Richtungswinkel der langen Achse der Ellipse, im Uhrzeigersinn ab Nord</translation>
    </message>
    <message>
        <source>points of the scene that are seen</source>
        <translation>Punkte der Szene, die gesehen werden</translation>
    </message>
    <message>
        <source>matches that agree, or that are to be expected</source>
        <translation>Zuordnungen, die übereinstimmen oder zu erwarten sind</translation>
    </message>
    <message>
        <source>matches before those that disagree were left out</source>
        <translation>Zuordnungen, bevor die falschen weggelassen wurden</translation>
    </message>
    <message>
        <source>edge of the tag in the picture</source>
        <translation>Kante der Marke im Bild</translation>
    </message>
    <message>
        <source>angle between the tag&apos;s normal and the line of sight</source>
        <translation>Winkel zwischen der Normalen der Marke und der Blicklinie</translation>
    </message>
    <message>
        <source>0: nothing controls the observation; 1: the others determine it</source>
        <translation>0: nichts kontrolliert die Beobachtung; 1: die anderen bestimmen sie</translation>
    </message>
    <message>
        <source>redundancy of the horizontal position</source>
        <translation>Redundanz der Lage</translation>
    </message>
    <message>
        <source>redundancy of the height</source>
        <translation>Redundanz der Höhe</translation>
    </message>
    <message>
        <source>smallest blunder that is found with 80 % probability</source>
        <translation>kleinster grober Fehler, der mit 80 % Wahrscheinlichkeit gefunden wird</translation>
    </message>
    <message>
        <source>smallest horizontal blunder that is found with 80 % probability</source>
        <translation>kleinster grober Fehler der Lage, der mit 80 % Wahrscheinlichkeit gefunden wird</translation>
    </message>
    <message>
        <source>smallest vertical blunder that is found with 80 % probability</source>
        <translation>kleinster grober Fehler der Höhe, der mit 80 % Wahrscheinlichkeit gefunden wird</translation>
    </message>
    <message>
        <source>how far an undetected blunder of that size moves the tag</source>
        <translation>wie weit ein unentdeckter grober Fehler dieser Größe die Marke verschiebt</translation>
    </message>
    <message>
        <source>how far an undetected horizontal blunder moves the tag</source>
        <translation>wie weit ein unentdeckter grober Fehler der Lage die Marke verschiebt</translation>
    </message>
    <message>
        <source>how far an undetected vertical blunder moves the tag</source>
        <translation>wie weit ein unentdeckter grober Fehler der Höhe die Marke verschiebt</translation>
    </message>
    <message>
        <source>whether it takes part</source>
        <translation>ob es mitwirkt</translation>
    </message>
    <message>
        <source>root mean square sigma of the tags in space, without the proposal</source>
        <translation>quadratisches Mittel der räumlichen Sigmas der Marken, ohne den Vorschlag</translation>
    </message>
    <message>
        <source>root mean square sigma of the tags in space, with the proposal</source>
        <translation>quadratisches Mittel der räumlichen Sigmas der Marken, mit dem Vorschlag</translation>
    </message>
    <message>
        <source>green, amber or red</source>
        <translation>green (grün), amber (gelb) oder red (rot)</translation>
    </message>
    <message>
        <source>what the finding is about</source>
        <translation>wovon der Befund handelt</translation>
    </message>
    <message>
        <source>what was found</source>
        <translation>was gefunden wurde</translation>
    </message>
    <message>
        <source>why it is proposed</source>
        <translation>warum es vorgeschlagen wird</translation>
    </message>
    <message>
        <source>where to stand, x in the frame of the map</source>
        <translation>wo man stehen soll, x im System der Karte</translation>
    </message>
    <message>
        <source>where to stand, y in the frame of the map</source>
        <translation>wo man stehen soll, y im System der Karte</translation>
    </message>
    <message>
        <source>where to stand, z in the frame of the map</source>
        <translation>wo man stehen soll, z im System der Karte</translation>
    </message>
    <message>
        <source>direction to look, clockwise from the map&apos;s y axis</source>
        <translation>Blickrichtung, im Uhrzeigersinn ab der y-Achse der Karte</translation>
    </message>
    <message>
        <source>direction that the tag faces, clockwise from north</source>
        <translation>Richtung, in die die Marke zeigt, im Uhrzeigersinn ab Nord</translation>
    </message>
    <message>
        <source>pictures that show the tag</source>
        <translation>Bilder, die die Marke zeigen</translation>
    </message>
    <message>
        <source>runs that show the tag</source>
        <translation>Fahrten, die die Marke zeigen</translation>
    </message>
    <message>
        <source>largest edge of the tag in a picture</source>
        <translation>größte Kante der Marke in einem Bild</translation>
    </message>
    <message>
        <source>smallest distance from which the tag was photographed</source>
        <translation>kleinste Entfernung, aus der die Marke aufgenommen wurde</translation>
    </message>
    <message>
        <source>direction farthest to the left from which it is seen, from the tag&apos;s normal</source>
        <translation>Richtung am weitesten links, aus der sie gesehen wird, ab der Normalen der Marke</translation>
    </message>
    <message>
        <source>direction farthest to the right from which it is seen, from the tag&apos;s normal</source>
        <translation>Richtung am weitesten rechts, aus der sie gesehen wird, ab der Normalen der Marke</translation>
    </message>
    <message>
        <source>first photo</source>
        <translation>erstes Foto</translation>
    </message>
    <message>
        <source>second photo</source>
        <translation>zweites Foto</translation>
    </message>
    <message>
        <source>focal length</source>
        <translation>Brennweite</translation>
    </message>
    <message>
        <source>pixel, to the right</source>
        <translation>Pixel, nach rechts</translation>
    </message>
    <message>
        <source>pixel, down</source>
        <translation>Pixel, nach unten</translation>
    </message>
    <message>
        <source>residual to the right: predicted minus observed</source>
        <translation>Residuum nach rechts: vorhergesagt minus beobachtet</translation>
    </message>
    <message>
        <source>residual down: predicted minus observed</source>
        <translation>Residuum nach unten: vorhergesagt minus beobachtet</translation>
    </message>
    <message>
        <source>whether points of the board were seen there</source>
        <translation>ob dort Punkte der Tafel gesehen wurden</translation>
    </message>
    <message>
        <source>points of the board that were used</source>
        <translation>Punkte der Tafel, die verwendet wurden</translation>
    </message>
    <message>
        <source>angle between the board and the picture</source>
        <translation>Winkel zwischen Tafel und Bild</translation>
    </message>
    <message>
        <source>distance of the board</source>
        <translation>Entfernung der Tafel</translation>
    </message>
    <message>
        <source>points of the board that were found</source>
        <translation>Punkte der Tafel, die gefunden wurden</translation>
    </message>
    <message>
        <source>number of the exposure: pictures with the same one were taken together</source>
        <translation>Nummer der Aufnahme: Bilder mit derselben Nummer entstanden zusammen</translation>
    </message>
    <message>
        <source>panoramas that other runs share</source>
        <translation>Panoramen, die andere Fahrten auch haben</translation>
    </message>
    <message>
        <source>tags that other runs share</source>
        <translation>Marken, die andere Fahrten auch haben</translation>
    </message>
    <message>
        <source>points that other runs share</source>
        <translation>Punkte, die andere Fahrten auch haben</translation>
    </message>
    <message>
        <source>1 sigma of the odometry&apos;s scale</source>
        <translation>1 Sigma des Maßstabs der Odometrie</translation>
    </message>
    <message>
        <source>largest movement of a camera against the run by itself</source>
        <translation>größte Verschiebung einer Kamera gegenüber der Fahrt für sich allein</translation>
    </message>
    <message>
        <source>models into which the reconstruction fell</source>
        <translation>Modelle, in die die Rekonstruktion zerfiel</translation>
    </message>
    <message>
        <source>images that the other program placed</source>
        <translation>Bilder, die das andere Programm einordnete</translation>
    </message>
    <message>
        <source>mean reprojection error of the other program</source>
        <translation>mittlerer Rückprojektionsfehler des anderen Programms</translation>
    </message>
    <message>
        <source>poses that both have</source>
        <translation>Posen, die beide haben</translation>
    </message>
    <message>
        <source>root mean square of the differences in space</source>
        <translation>quadratisches Mittel der räumlichen Differenzen</translation>
    </message>
    <message>
        <source>median angle between the rotations</source>
        <translation>Median des Winkels zwischen den Drehungen</translation>
    </message>
    <message>
        <source>largest angle between the rotations</source>
        <translation>größter Winkel zwischen den Drehungen</translation>
    </message>
    <message>
        <source>median difference over our stated covariance</source>
        <translation>Median der Differenz in Einheiten unserer angegebenen Kovarianz</translation>
    </message>
    <message>
        <source>95th percentile of the differences over our stated covariance</source>
        <translation>95. Perzentil der Differenzen in Einheiten unserer angegebenen Kovarianz</translation>
    </message>
    <message>
        <source>share of the differences beyond the 99 % value of our covariance: 0.01 by chance</source>
        <translation>Anteil der Differenzen über dem 99-%-Wert unserer Kovarianz: zufällig 0,01</translation>
    </message>
    <message>
        <source>step of the other program</source>
        <translation>Schritt des anderen Programms</translation>
    </message>
    <message>
        <source>time that it took</source>
        <translation>benötigte Zeit</translation>
    </message>
    <message>
        <source>time of all processors</source>
        <translation>Zeit aller Prozessoren</translation>
    </message>
    <message>
        <source>largest memory, MiB</source>
        <translation>größter Speicherbedarf, MiB</translation>
    </message>
    <message>
        <source>how the two programs agree</source>
        <translation>wie die beiden Programme übereinstimmen</translation>
    </message>
    <message>
        <source>our status and reason</source>
        <translation>unser Zustand und Grund</translation>
    </message>
    <message>
        <source>how the two were aligned</source>
        <translation>wie die beiden aufeinander gelegt wurden</translation>
    </message>
    <message>
        <source>image or panorama</source>
        <translation>Bild oder Panorama</translation>
    </message>
    <message>
        <source>theirs minus ours, x</source>
        <translation>deren Wert minus unserer, x</translation>
    </message>
    <message>
        <source>theirs minus ours, y</source>
        <translation>deren Wert minus unserer, y</translation>
    </message>
    <message>
        <source>theirs minus ours, z</source>
        <translation>deren Wert minus unserer, z</translation>
    </message>
    <message>
        <source>length of the difference</source>
        <translation>Länge der Differenz</translation>
    </message>
    <message>
        <source>angle between the rotations</source>
        <translation>Winkel zwischen den Drehungen</translation>
    </message>
    <message>
        <source>difference over our stated covariance: about 1 if they agree within it</source>
        <translation>Differenz in Einheiten unserer angegebenen Kovarianz: etwa 1, wenn beide darin übereinstimmen</translation>
    </message>
    <message>
        <source>rotation, part %1 of its unit quaternion</source>
        <translation>Drehung, Teil %1 ihres Einheitsquaternions</translation>
    </message>
    <message>
        <source>1 sigma of the position, %1</source>
        <translation>1 Sigma der Position, %1</translation>
    </message>
    <message>
        <source>row %1, column %2 of the 6 x 6 covariance: rotation (rad) first, then translation (m)</source>
        <translation>Zeile %1, Spalte %2 der 6-x-6-Kovarianz: zuerst Drehung (rad), dann Verschiebung (m)</translation>
    </message>
    <message>
        <source>pixel %1 of corner %2 (0 bottom-left, then counter-clockwise)</source>
        <translation>Pixel %1 der Ecke %2 (0 unten links, dann gegen den Uhrzeigersinn)</translation>
    </message>
    <message>
        <source>%1 offset of the station from its tag, %2</source>
        <translation>%1 Abstand der Station von ihrer Marke, %2</translation>
    </message>
    <message>
        <source>1 sigma of the offset, %1</source>
        <translation>1 Sigma des Abstands, %1</translation>
    </message>
    <message>
        <source>row and column of the covariance belong to this pose (%1)</source>
        <translation>Zeile und Spalte der Kovarianz gehören zu dieser Pose (%1)</translation>
    </message>
    <message>
        <source>site: x east, y north, z up from its origin</source>
        <translation>Messgebiet: x Ost, y Nord, z oben ab seinem Ursprung</translation>
    </message>
    <message>
        <source>the surveyor&apos;s own, not georeferenced</source>
        <translation>das des Vermessers, ohne Georeferenz</translation>
    </message>
    <message>
        <source>the tag map&apos;s own, without a datum</source>
        <translation>das der Markenkarte, ohne Datum</translation>
    </message>
    <message>
        <source>the run&apos;s own (odom)</source>
        <translation>das der Fahrt (odom)</translation>
    </message>
    <message>
        <source>Frame: %1</source>
        <translation>System: %1</translation>
    </message>
    <message>
        <source>In the file: %1</source>
        <translation>In der Datei: %1</translation>
    </message>
</context>
<context>
    <name>QObject</name>
    <message>
        <source>%1
%2 px</source>
        <translation>%1
%2 px</translation>
    </message>
    <message>
        <source>proposed %1</source>
        <translation>Vorschlag %1</translation>
    </message>
</context>
<context>
    <name>Report</name>
    <message>
        <source>language</source>
        <translation>Sprache</translation>
    </message>
    <message>
        <source>%1 run</source>
        <translation>%1 Fahrt</translation>
    </message>
    <message>
        <source>%1 runs</source>
        <translation>%1 Fahrten</translation>
    </message>
    <message>
        <source>%1 image</source>
        <translation>%1 Bild</translation>
    </message>
    <message>
        <source>%1 images</source>
        <translation>%1 Bilder</translation>
    </message>
    <message>
        <source>%1 panorama</source>
        <translation>%1 Panorama</translation>
    </message>
    <message>
        <source>%1 panoramas</source>
        <translation>%1 Panoramen</translation>
    </message>
    <message>
        <source>%1 photo</source>
        <translation>%1 Foto</translation>
    </message>
    <message>
        <source>%1 photos</source>
        <translation>%1 Fotos</translation>
    </message>
    <message>
        <source>%1 answer</source>
        <translation>%1 Antwort</translation>
    </message>
    <message>
        <source>%1 answers</source>
        <translation>%1 Antworten</translation>
    </message>
    <message>
        <source>%1 station</source>
        <translation>%1 Station</translation>
    </message>
    <message>
        <source>%1 stations</source>
        <translation>%1 Stationen</translation>
    </message>
    <message>
        <source>%1 pair</source>
        <translation>%1 Paar</translation>
    </message>
    <message>
        <source>%1 pairs</source>
        <translation>%1 Paare</translation>
    </message>
    <message>
        <source>%1 match</source>
        <translation>%1 Zuordnung</translation>
    </message>
    <message>
        <source>%1 matches</source>
        <translation>%1 Zuordnungen</translation>
    </message>
    <message>
        <source>%1 time</source>
        <translation>%1-mal</translation>
    </message>
    <message>
        <source>%1 times</source>
        <translation>%1-mal</translation>
    </message>
    <message>
        <source>%1 surveyed point</source>
        <translation>%1 eingemessener Punkt</translation>
    </message>
    <message>
        <source>%1 surveyed points</source>
        <translation>%1 eingemessene Punkte</translation>
    </message>
    <message>
        <source>%1 check point</source>
        <translation>%1 Kontrollpunkt</translation>
    </message>
    <message>
        <source>%1 check points</source>
        <translation>%1 Kontrollpunkte</translation>
    </message>
    <message>
        <source>%1 difference</source>
        <translation>%1 Differenz</translation>
    </message>
    <message>
        <source>%1 differences</source>
        <translation>%1 Differenzen</translation>
    </message>
    <message>
        <source>%1 references</source>
        <translation>%1 Referenzen</translation>
    </message>
    <message>
        <source>%1 maps</source>
        <translation>%1 Karten</translation>
    </message>
    <message>
        <source>%1 pieces of path</source>
        <translation>%1 Wegstücke</translation>
    </message>
    <message>
        <source>%1 of %2</source>
        <translation>%1 von %2</translation>
    </message>
    <message>
        <source>%1 and %2</source>
        <translation>%1 und %2</translation>
    </message>
    <message>
        <source>%1 to %2</source>
        <translation>%1 bis %2</translation>
    </message>
    <message>
        <source>%1 (%2)</source>
        <translation>%1 (%2)</translation>
    </message>
    <message>
        <source>%1 against %2</source>
        <translation>%1 gegen %2</translation>
    </message>
    <message>
        <source>%1 on %2</source>
        <translation>%1 auf %2</translation>
    </message>
    <message>
        <source>panoramas</source>
        <translation>Panoramen</translation>
    </message>
    <message>
        <source>photos</source>
        <translation>Fotos</translation>
    </message>
    <message>
        <source>panoramas and photos</source>
        <translation>Panoramen und Fotos</translation>
    </message>
    <message>
        <source>panorama</source>
        <translation>Panorama</translation>
    </message>
    <message>
        <source>view</source>
        <translation>Ansicht</translation>
    </message>
    <message>
        <source>panorama (G2)</source>
        <translation>Panorama (G2)</translation>
    </message>
    <message>
        <source>view (G1)</source>
        <translation>Ansicht (G1)</translation>
    </message>
    <message>
        <source>variant %1</source>
        <translation>Variante %1</translation>
    </message>
    <message>
        <source>absolute</source>
        <translation>absolut</translation>
    </message>
    <message>
        <source>relative</source>
        <translation>relativ</translation>
    </message>
    <message>
        <source>against %1</source>
        <translation>gegen %1</translation>
    </message>
    <message>
        <source>surveyed control</source>
        <translation>eingemessene Passpunkte</translation>
    </message>
    <message>
        <source>the run&apos;s own tags</source>
        <translation>die Marken der Fahrt selbst</translation>
    </message>
    <message>
        <source>the tag map</source>
        <translation>die Markenkarte</translation>
    </message>
    <message>
        <source>localized</source>
        <translation>lokalisiert</translation>
    </message>
    <message>
        <source>refused</source>
        <translation>abgelehnt</translation>
    </message>
    <message>
        <source>no match</source>
        <translation>nicht zugeordnet</translation>
    </message>
    <message>
        <source>no reference</source>
        <translation>ohne Referenz</translation>
    </message>
    <message>
        <source>missing</source>
        <translation>fehlt</translation>
    </message>
    <message>
        <source>passed</source>
        <translation>bestanden</translation>
    </message>
    <message>
        <source>failed</source>
        <translation>nicht bestanden</translation>
    </message>
    <message>
        <source>undecided</source>
        <translation>unentschieden</translation>
    </message>
    <message>
        <source>east</source>
        <translation>Ost</translation>
    </message>
    <message>
        <source>north</source>
        <translation>Nord</translation>
    </message>
    <message>
        <source>up</source>
        <translation>hoch</translation>
    </message>
    <message>
        <source>horizontally</source>
        <translation>horizontal</translation>
    </message>
    <message>
        <source>vertically</source>
        <translation>vertikal</translation>
    </message>
    <message>
        <source>Located</source>
        <translation>Lokalisiert</translation>
    </message>
    <message>
        <source>Relative error, 3D</source>
        <translation>Relativer Fehler, 3D</translation>
    </message>
    <message>
        <source>Absolute error, 3D</source>
        <translation>Absoluter Fehler, 3D</translation>
    </message>
    <message>
        <source>Absolute difference, 3D</source>
        <translation>Absolute Differenz, 3D</translation>
    </message>
    <message>
        <source>Common shift</source>
        <translation>Gemeinsamer Versatz</translation>
    </message>
    <message>
        <source>Stated uncertainty</source>
        <translation>Angegebene Unsicherheit</translation>
    </message>
    <message>
        <source>Agreement of runs</source>
        <translation>Übereinstimmung der Fahrten</translation>
    </message>
    <message>
        <source>Outlying geotags</source>
        <translation>Abweichende Geotags</translation>
    </message>
    <message>
        <source>Stated sigmas</source>
        <translation>Angegebene Sigmas</translation>
    </message>
    <message>
        <source>Check points, 3D</source>
        <translation>Kontrollpunkte, 3D</translation>
    </message>
    <message>
        <source>consistent</source>
        <translation>stimmig</translation>
    </message>
    <message>
        <source>too large</source>
        <translation>zu groß</translation>
    </message>
    <message>
        <source>too small</source>
        <translation>zu klein</translation>
    </message>
    <message>
        <source>mixed</source>
        <translation>uneinheitlich</translation>
    </message>
    <message>
        <source>In the run&apos;s own frame, against %1</source>
        <translation>Im eigenen System der Fahrt, gegen %1</translation>
    </message>
    <message>
        <source>In site coordinates, against %1</source>
        <translation>In Koordinaten des Messgebiets, gegen %1</translation>
    </message>
    <message>
        <source>In site coordinates, against %1, which shares data with the answers: agreement, not accuracy</source>
        <translation>In Koordinaten des Messgebiets, gegen %1; beide nutzen dieselben Daten: Übereinstimmung, nicht Genauigkeit</translation>
    </message>
    <message>
        <source>part of the absolute error that all answers share, by %1 (length of the mean error)</source>
        <translation>Teil des absoluten Fehlers, der allen Antworten gemeinsam ist, durch %1 (Länge des mittleren Fehlers)</translation>
    </message>
    <message>
        <source>the geotags&apos; own error</source>
        <translation>den Fehler der Geotags</translation>
    </message>
    <message>
        <source>the GPS&apos;s own error</source>
        <translation>den Fehler des GPS</translation>
    </message>
    <message>
        <source>the georeference</source>
        <translation>die Georeferenz</translation>
    </message>
    <message>
        <source>median distance between the places that two runs give a panorama, %1</source>
        <translation>Median des Abstands der Orte, die zwei Fahrten einem Panorama geben, %1</translation>
    </message>
    <message>
        <source>%1 whose geotag the runs contradict</source>
        <translation>%1, deren Geotag die Fahrten widersprechen</translation>
    </message>
    <message>
        <source>in runs&apos; own frames %1: %2</source>
        <translation>in den eigenen Systemen der Fahrten %1: %2</translation>
    </message>
    <message>
        <source>RMSE of the tag map at %1 it was not fitted to</source>
        <translation>RMSE der Markenkarte an %1, an die sie nicht angepasst wurde</translation>
    </message>
    <message>
        <source>%1 located</source>
        <translation>%1 lokalisiert</translation>
    </message>
    <message>
        <source>%1 of %2 located</source>
        <translation>%1 von %2 lokalisiert</translation>
    </message>
    <message>
        <source>%1 of %2 located, median %3 error</source>
        <translation>%1 von %2 lokalisiert, Median des Fehlers, %3</translation>
    </message>
    <message>
        <source>reconstructed</source>
        <translation>rekonstruiert</translation>
    </message>
    <message>
        <source>not georeferenced</source>
        <translation>nicht georeferenziert</translation>
    </message>
    <message>
        <source>The %1 runs with the largest median of %2.</source>
        <translation>Die %1 Fahrten mit dem größten Median, von %2.</translation>
    </message>
    <message>
        <source>%1 localized against %2</source>
        <translation>%1 lokalisiert gegen %2</translation>
    </message>
    <message>
        <source>There is no reference to compare the answers with, so their accuracy is not measured here</source>
        <translation>Es gibt keine Referenz für die Antworten; ihre Genauigkeit wird hier nicht gemessen</translation>
    </message>
    <message>
        <source>%1 without panoramas or photos of known position: there is nothing to localize</source>
        <translation>%1 ohne Panoramen oder Fotos an bekannten Orten: es gibt nichts zu lokalisieren</translation>
    </message>
    <message>
        <source>The poses of the images are in results/localize/&lt;run&gt;/cameras_odom.tum</source>
        <translation>Die Posen der Bilder stehen in results/localize/&lt;run&gt;/cameras_odom.tum</translation>
    </message>
    <message>
        <source>No run of this project is localized yet, so there are no answers to show.</source>
        <translation>Noch ist keine Fahrt dieses Projekts lokalisiert; es gibt keine Antworten.</translation>
    </message>
    <message>
        <source>There are neither photos nor runs, so there is nothing to localize.</source>
        <translation>Es gibt weder Fotos noch Fahrten, also nichts zu lokalisieren.</translation>
    </message>
    <message>
        <source>There are photos but no run, so there is nothing to localize.</source>
        <translation>Es gibt Fotos, aber keine Fahrt, also nichts zu lokalisieren.</translation>
    </message>
    <message>
        <source>Sets of photos are stitched to panoramas.</source>
        <translation>Fotosätze werden zu Panoramen zusammengesetzt.</translation>
    </message>
    <message>
        <source>The evaluation is out of date: its numbers belong to earlier results.</source>
        <translation>Die Auswertung ist veraltet: ihre Zahlen gehören zu früheren Ergebnissen.</translation>
    </message>
    <message>
        <source>The evaluation is out of date (%1): its numbers belong to earlier results.</source>
        <translation>Die Auswertung ist veraltet (%1): ihre Zahlen gehören zu früheren Ergebnissen.</translation>
    </message>
    <message>
        <source>The evaluation is failed: its numbers belong to earlier results.</source>
        <translation>Die Auswertung ist fehlgeschlagen: ihre Zahlen gehören zu früheren Ergebnissen.</translation>
    </message>
    <message>
        <source>The evaluation is failed (%1): its numbers belong to earlier results.</source>
        <translation>Die Auswertung ist fehlgeschlagen (%1): ihre Zahlen gehören zu früheren Ergebnissen.</translation>
    </message>
    <message>
        <source>The table of gates is out of date: its numbers belong to earlier results.</source>
        <translation>Die Tabelle der Abnahmegrenzen ist veraltet: ihre Zahlen gehören zu früheren Ergebnissen.</translation>
    </message>
    <message>
        <source>The table of gates is out of date (%1): its numbers belong to earlier results.</source>
        <translation>Die Tabelle der Abnahmegrenzen ist veraltet (%1): ihre Zahlen gehören zu früheren Ergebnissen.</translation>
    </message>
    <message>
        <source>Look at these first</source>
        <translation>Zuerst ansehen</translation>
    </message>
    <message>
        <source>Largest error: %1 at %2, %3</source>
        <translation>Größter Fehler: %1 an %2, %3</translation>
    </message>
    <message>
        <source>%1 absolute</source>
        <translation>%1 absolut</translation>
    </message>
    <message>
        <source>%1 relative</source>
        <translation>%1 relativ</translation>
    </message>
    <message>
        <source>Outlying geotag: %1, %2 %3 from the answer</source>
        <translation>Abweichender Geotag: %1, %2 %3 von der Antwort entfernt</translation>
    </message>
    <message>
        <source>Outlying geotag: %1, %2 %3 from the answer (%4 sigma)</source>
        <translation>Abweichender Geotag: %1, %2 %3 von der Antwort entfernt (%4 Sigma)</translation>
    </message>
    <message>
        <source>Outlying geotag: %1, %2 %3 from the answer of %4</source>
        <translation>Abweichender Geotag: %1, %2 %3 von der Antwort von %4 entfernt</translation>
    </message>
    <message>
        <source>Outlying geotag: %1, %2 %3 from the answer of %4 (%5 sigma)</source>
        <translation>Abweichender Geotag: %1, %2 %3 von der Antwort von %4 entfernt (%5 Sigma)</translation>
    </message>
    <message>
        <source>%1 is not georeferenced</source>
        <translation>%1 ist nicht georeferenziert</translation>
    </message>
    <message>
        <source>%1 is not georeferenced: %2</source>
        <translation>%1 ist nicht georeferenziert: %2</translation>
    </message>
    <message>
        <source>Refused: %1 at %2</source>
        <translation>Abgelehnt: %1 an %2</translation>
    </message>
    <message>
        <source>Refused: %1 at %2, %3</source>
        <translation>Abgelehnt: %1 an %2, %3</translation>
    </message>
    <message>
        <source>Not matched: %1 at %2</source>
        <translation>Nicht zugeordnet: %1 an %2</translation>
    </message>
    <message>
        <source>Not matched: %1 at %2, %3</source>
        <translation>Nicht zugeordnet: %1 an %2, %3</translation>
    </message>
    <message>
        <source>Quality gates: %1</source>
        <translation>Grenzwerte: %1</translation>
    </message>
    <message>
        <source>Default gates (trigpoint.yaml sets none): %1</source>
        <translation>Vorgegebene Grenzwerte (trigpoint.yaml setzt keine): %1</translation>
    </message>
    <message>
        <source>%1, %2 of %3 passed</source>
        <translation>%1, %2 von %3 bestanden</translation>
    </message>
    <message>
        <source>And %1 more</source>
        <translation>Und %1 weitere</translation>
    </message>
    <message>
        <source>%1 &lt;= %2</source>
        <translation>%1 &lt;= %2</translation>
    </message>
    <message>
        <source>%1 &gt;= %2</source>
        <translation>%1 &gt;= %2</translation>
    </message>
    <message>
        <source>%1 % interval %2 to %3</source>
        <translation>%1-%-Intervall %2 bis %3</translation>
    </message>
    <message>
        <source>%1 % interval from %2</source>
        <translation>%1-%-Intervall ab %2</translation>
    </message>
    <message>
        <source>n = %1</source>
        <translation>n = %1</translation>
    </message>
    <message>
        <source>not evaluated</source>
        <translation>nicht ausgewertet</translation>
    </message>
    <message>
        <source>the value is too near the limit for more stations or runs to decide</source>
        <translation>der Wert liegt zu nah am Grenzwert, als dass mehr Stationen oder Fahrten entscheiden könnten</translation>
    </message>
    <message>
        <source>about %1 more station would decide</source>
        <translation>etwa %1 Station mehr würde entscheiden</translation>
    </message>
    <message>
        <source>about %1 more stations would decide</source>
        <translation>etwa %1 Stationen mehr würden entscheiden</translation>
    </message>
    <message>
        <source>about %1 more run would decide</source>
        <translation>etwa %1 Fahrt mehr würde entscheiden</translation>
    </message>
    <message>
        <source>about %1 more runs would decide</source>
        <translation>etwa %1 Fahrten mehr würden entscheiden</translation>
    </message>
    <message>
        <source>about %1 more stations, or about %2 more runs past the same ones, would decide</source>
        <translation>etwa %1 Stationen mehr, oder etwa %2 Fahrten mehr an denselben vorbei, würden entscheiden</translation>
    </message>
    <message>
        <source>about %1 more stations, or about %2 more run past the same ones, would decide</source>
        <translation>etwa %1 Stationen mehr, oder etwa %2 Fahrt mehr an denselben vorbei, würden entscheiden</translation>
    </message>
    <message>
        <source>about %1 more station, or about %2 more run past the same ones, would decide</source>
        <translation>etwa %1 Station mehr, oder etwa %2 Fahrt mehr an denselben vorbei, würden entscheiden</translation>
    </message>
    <message>
        <source>no answer with a reference</source>
        <translation>keine Antwort mit einer Referenz</translation>
    </message>
    <message>
        <source>too few answers for an interval</source>
        <translation>zu wenige Antworten für ein Intervall</translation>
    </message>
    <message>
        <source>no attempt</source>
        <translation>kein Versuch</translation>
    </message>
    <message>
        <source>no joint covariance of answers and reference</source>
        <translation>keine gemeinsame Kovarianz von Antworten und Referenz</translation>
    </message>
    <message>
        <source>the map has no check point</source>
        <translation>die Karte hat keinen Kontrollpunkt</translation>
    </message>
    <message>
        <source>the largest is that of %1</source>
        <translation>der größte Wert ist der von %1</translation>
    </message>
    <message>
        <source>the largest is that of tag %1</source>
        <translation>der größte Wert ist der von Marke %1</translation>
    </message>
    <message>
        <source>agreement: the reference shares evidence with the runs</source>
        <translation>Übereinstimmung: die Referenz nutzt dieselben Daten wie die Fahrten</translation>
    </message>
    <message>
        <source>fewer than two runs that can be mapped by themselves</source>
        <translation>weniger als zwei Fahrten, die für sich eine Karte ergeben</translation>
    </message>
    <message>
        <source>no reference was asked for</source>
        <translation>es wurde nach keiner Referenz gefragt</translation>
    </message>
    <message>
        <source>no image has both an estimate and a reference</source>
        <translation>kein Bild hat Schätzung und Referenz</translation>
    </message>
    <message>
        <source>%1 was not run</source>
        <translation>%1 wurde nicht ausgeführt</translation>
    </message>
    <message>
        <source>%1 is out of date</source>
        <translation>%1 ist veraltet</translation>
    </message>
    <message>
        <source>%1 is missing</source>
        <translation>%1 fehlt</translation>
    </message>
    <message>
        <source>%1 answers of %2 attempts</source>
        <translation>%1 Antworten von %2 Versuchen</translation>
    </message>
    <message>
        <source>no image of the run looks like it</source>
        <translation>kein Bild der Fahrt sieht ihm ähnlich</translation>
    </message>
    <message>
        <source>no match with a point of the run</source>
        <translation>keine Zuordnung zu einem Punkt der Fahrt</translation>
    </message>
    <message>
        <source>only %1 with points of the run</source>
        <translation>nur %1 zu Punkten der Fahrt</translation>
    </message>
    <message>
        <source>no pose explains the matches</source>
        <translation>keine Pose erklärt die Zuordnungen</translation>
    </message>
    <message>
        <source>no pose explains the matches (%1 of %2 agree)</source>
        <translation>keine Pose erklärt die Zuordnungen (%1 von %2 stimmen überein)</translation>
    </message>
    <message>
        <source>%1 points of the run fit the pose, %2 needed</source>
        <translation>%1 Punkte der Fahrt passen zur Pose, %2 sind nötig</translation>
    </message>
    <message>
        <source>%1 matches with points, %2 needed</source>
        <translation>%1 Zuordnungen zu Punkten, %2 sind nötig</translation>
    </message>
    <message>
        <source>too far from the nearest camera</source>
        <translation>zu weit von der nächsten Kamera</translation>
    </message>
    <message>
        <source>no view (G1) could be located by itself</source>
        <translation>keine Ansicht (G1) ließ sich für sich lokalisieren</translation>
    </message>
    <message>
        <source>no view matches</source>
        <translation>keine Ansicht hat Zuordnungen</translation>
    </message>
    <message>
        <source>no view matched</source>
        <translation>keine Ansicht hat Zuordnungen</translation>
    </message>
    <message>
        <source>not in panoramas.csv</source>
        <translation>nicht in panoramas.csv</translation>
    </message>
    <message>
        <source>no reference with a geotag is localized, and no GPS is used</source>
        <translation>keine Referenz mit Geotag ist lokalisiert, und GPS wird nicht benutzt</translation>
    </message>
    <message>
        <source>ambiguous: another pose, %1 away, explains %2 matches against %3</source>
        <translation>mehrdeutig: eine andere Pose, %1 entfernt, erklärt %2 Zuordnungen gegen %3</translation>
    </message>
    <message>
        <source>Plan, x and y in %1 (%2)</source>
        <translation>Plan, x und y in %1 (%2)</translation>
    </message>
    <message>
        <source>site ENU</source>
        <translation>ENU des Messgebiets</translation>
    </message>
    <message>
        <source>%1, against %2, %3</source>
        <translation>%1, gegen %2, %3</translation>
    </message>
    <message>
        <source>at true scale</source>
        <translation>in wahrer Größe</translation>
    </message>
    <message>
        <source>%1 times enlarged</source>
        <translation>%1-fach vergrößert</translation>
    </message>
    <message>
        <source>Without ellipse or head: %1 that reach too far for this enlargement</source>
        <translation>Ohne Ellipse oder Spitze: %1, die für diese Vergrößerung zu weit reichen</translation>
    </message>
    <message>
        <source>Without ellipse or head: %1 that reaches too far for this enlargement</source>
        <translation>Ohne Ellipse oder Spitze: %1, die für diese Vergrößerung zu weit reicht</translation>
    </message>
    <message>
        <source>difference x %1</source>
        <translation>Differenz x %1</translation>
    </message>
    <message>
        <source>its 95 % ellipse x %1</source>
        <translation>95-%-Ellipse x %1</translation>
    </message>
    <message>
        <source>east (%1)</source>
        <translation>Ost (%1)</translation>
    </message>
    <message>
        <source>north (%1)</source>
        <translation>Nord (%1)</translation>
    </message>
    <message>
        <source>up (%1)</source>
        <translation>hoch (%1)</translation>
    </message>
    <message>
        <source>share</source>
        <translation>Anteil</translation>
    </message>
    <message>
        <source>3D difference (%1)</source>
        <translation>3D-Differenz (%1)</translation>
    </message>
    <message>
        <source>share of attempts</source>
        <translation>Anteil der Versuche</translation>
    </message>
    <message>
        <source>Cumulative histogram of %1 3D differences from %2: the share of attempts with at most this difference (%3, logarithmic)</source>
        <translation>Summenhistogramm der 3D-Differenzen (%1) von %2: Anteil der Versuche mit höchstens dieser Differenz (%3, logarithmisch)</translation>
    </message>
    <message>
        <source>Cumulative histogram of %1 3D differences from %2, which share data with the answers: the share of attempts with at most this difference (%3, logarithmic)</source>
        <translation>Summenhistogramm der 3D-Differenzen (%1) von %2 mit Daten, die auch die Antworten nutzen: Anteil der Versuche mit höchstens dieser Differenz (%3, logarithmisch)</translation>
    </message>
    <message>
        <source>Cumulative histogram of %1 3D differences from %2</source>
        <translation>Summenhistogramm der 3D-Differenzen (%1) von %2</translation>
    </message>
    <message>
        <source>Cumulative histogram of %1 3D differences from %2, which share data with the answers</source>
        <translation>Summenhistogramm der 3D-Differenzen (%1) von %2 mit gemeinsamen Daten</translation>
    </message>
    <message>
        <source>A curve ends where the answers end: the rest are abstentions</source>
        <translation>Eine Kurve endet, wo die Antworten enden: der Rest sind Enthaltungen</translation>
    </message>
    <message>
        <source>Band: pointwise %1 % confidence of %2, resampled by station and run</source>
        <translation>Band: punktweises %1-%-Vertrauen von %2, nach Station und Fahrt neu gezogen</translation>
    </message>
    <message>
        <source>3D difference by station and run</source>
        <translation>3D-Differenz nach Station und Fahrt</translation>
    </message>
    <message>
        <source>3D difference by station and run (%1, logarithmic), %2</source>
        <translation>3D-Differenz nach Station und Fahrt (%1, logarithmisch), %2</translation>
    </message>
    <message>
        <source>%1 against %2, %3</source>
        <translation>%1 gegen %2, %3</translation>
    </message>
    <message>
        <source>every station with an answer</source>
        <translation>jede Station mit einer Antwort</translation>
    </message>
    <message>
        <source>the %1 stations with the largest differences of %2</source>
        <translation>die %1 Stationen mit den größten Differenzen von %2</translation>
    </message>
    <message>
        <source>%1 (n = %2)</source>
        <translation>%1 (n = %2)</translation>
    </message>
    <message>
        <source>Trust curve</source>
        <translation>Vertrauenskurve</translation>
    </message>
    <message>
        <source>Trust curve of variant %1</source>
        <translation>Vertrauenskurve der Variante %1</translation>
    </message>
    <message>
        <source>share of the errors inside the confidence region of the stated level (NEES against chi-square)</source>
        <translation>Anteil der Fehler innerhalb des Vertrauensbereichs der angegebenen Stufe (NEES gegen Chi-Quadrat)</translation>
    </message>
    <message>
        <source>stated confidence</source>
        <translation>angegebenes Vertrauen</translation>
    </message>
    <message>
        <source>share of errors inside</source>
        <translation>Anteil der Fehler innerhalb</translation>
    </message>
    <message>
        <source>chi-square, 3 dof</source>
        <translation>Chi-Quadrat, 3 Freiheitsgrade</translation>
    </message>
    <message>
        <source>Normalised errors squared per degree of freedom</source>
        <translation>Normierte Fehlerquadrate je Freiheitsgrad</translation>
    </message>
    <message>
        <source>Normalised errors squared per degree of freedom of variant %1</source>
        <translation>Normierte Fehlerquadrate je Freiheitsgrad, Variante %1</translation>
    </message>
    <message>
        <source>the last bin holds everything beyond it</source>
        <translation>die letzte Klasse enthält alles darüber</translation>
    </message>
    <message>
        <source>the last bin holds everything beyond</source>
        <translation>die letzte Klasse enthält alles darüber</translation>
    </message>
    <message>
        <source>Dashed: expected if the sigmas are right</source>
        <translation>Gestrichelt: erwartet, wenn die Sigmas stimmen</translation>
    </message>
    <message>
        <source>NEES / dof</source>
        <translation>NEES / Freiheitsgrad</translation>
    </message>
    <message>
        <source>Coverage and risk</source>
        <translation>Abdeckung und Risiko</translation>
    </message>
    <message>
        <source>Coverage and risk of variant %1</source>
        <translation>Abdeckung und Risiko der Variante %1</translation>
    </message>
    <message>
        <source>the 90th percentile of the 3D errors (%1) of the share of answers with the best supported depth</source>
        <translation>das 90. Perzentil der 3D-Fehler (%1) des Anteils der Antworten mit der am besten gestützten Tiefe</translation>
    </message>
    <message>
        <source>Where the curve falls towards the left, refusing the other answers reduces the error</source>
        <translation>Wo die Kurve nach links fällt, verkleinert das Ablehnen der anderen Antworten den Fehler</translation>
    </message>
    <message>
        <source>share of answers kept</source>
        <translation>Anteil der behaltenen Antworten</translation>
    </message>
    <message>
        <source>P90 of 3D error (%1)</source>
        <translation>P90 des 3D-Fehlers (%1)</translation>
    </message>
    <message>
        <source>Camera errors of %1 on %2</source>
        <translation>Kamerafehler von %1 auf %2</translation>
    </message>
    <message>
        <source>Camera errors of %1 on %2: estimate minus reference along the run</source>
        <translation>Kamerafehler von %1 auf %2: Schätzung minus Referenz entlang der Fahrt</translation>
    </message>
    <message>
        <source>Band: two sigmas of that difference, the reference&apos;s and, where stated, the estimate&apos;s together</source>
        <translation>Band: zwei Sigmas dieser Differenz, die der Referenz und, wo angegeben, der Schätzung zusammen</translation>
    </message>
    <message>
        <source>time since the first image (s)</source>
        <translation>Zeit seit dem ersten Bild (s)</translation>
    </message>
    <message>
        <source>%1 results together</source>
        <translation>%1 Resultate zusammen</translation>
    </message>
    <message>
        <source>Residuals of the runs&apos; own points</source>
        <translation>Residuen der Punkte der Fahrten</translation>
    </message>
    <message>
        <source>Residuals of the runs&apos; own points: mean reprojection error of each point over its images (px)</source>
        <translation>Residuen der Punkte der Fahrten: mittlerer Rückprojektionsfehler jedes Punktes über seine Bilder (px)</translation>
    </message>
    <message>
        <source>They measure how well images and points agree, not how accurate a position is</source>
        <translation>Sie messen, wie gut Bilder und Punkte übereinstimmen, nicht wie genau eine Position ist</translation>
    </message>
    <message>
        <source>mean reprojection error of a point (px)</source>
        <translation>mittlerer Rückprojektionsfehler eines Punktes (px)</translation>
    </message>
    <message>
        <source>Track lengths</source>
        <translation>Spurlängen</translation>
    </message>
    <message>
        <source>Track lengths: the number of images that see a point</source>
        <translation>Spurlängen: Anzahl der Bilder, die einen Punkt sehen</translation>
    </message>
    <message>
        <source>images that see a point</source>
        <translation>Bilder, die einen Punkt sehen</translation>
    </message>
    <message>
        <source>Residuals over time</source>
        <translation>Residuen über die Zeit</translation>
    </message>
    <message>
        <source>of each image the mean, over the points it sees, of their reprojection errors (px)</source>
        <translation>von jedem Bild der mittlere Rückprojektionsfehler der Punkte, die es sieht (px)</translation>
    </message>
    <message>
        <source>time since the run began (s)</source>
        <translation>Zeit seit Beginn der Fahrt (s)</translation>
    </message>
    <message>
        <source>mean reprojection error (px)</source>
        <translation>mittlerer Rückprojektionsfehler (px)</translation>
    </message>
    <message>
        <source>every tag</source>
        <translation>jede Marke</translation>
    </message>
    <message>
        <source>the %1 tags with the largest of %2</source>
        <translation>die %1 Marken mit den größten von %2</translation>
    </message>
    <message>
        <source>Residuals of tags</source>
        <translation>Residuen der Marken</translation>
    </message>
    <message>
        <source>Residuals of tags: root mean square over the corners of a tag in its images (px, logarithmic)</source>
        <translation>Residuen der Marken: quadratisches Mittel über die Ecken einer Marke in ihren Bildern (px, logarithmisch)</translation>
    </message>
    <message>
        <source>corner residual (px)</source>
        <translation>Eckenresiduum (px)</translation>
    </message>
    <message>
        <source>Surveyed points from above</source>
        <translation>Eingemessene Punkte von oben</translation>
    </message>
    <message>
        <source>Surveyed points from above, site coordinates in %1</source>
        <translation>Eingemessene Punkte von oben, Koordinaten des Messgebiets in %1</translation>
    </message>
    <message>
        <source>An arrow that leaves its ellipse is larger than stated sigmas explain</source>
        <translation>Ein Pfeil, der seine Ellipse verlässt, ist größer als die angegebenen Sigmas erklären</translation>
    </message>
    <message>
        <source>control</source>
        <translation>Passpunkt</translation>
    </message>
    <message>
        <source>check</source>
        <translation>Kontrollpunkt</translation>
    </message>
    <message>
        <source>other tag</source>
        <translation>andere Marke</translation>
    </message>
    <message>
        <source>%1 %2 of a residual</source>
        <translation>%1 %2 eines Residuums</translation>
    </message>
    <message>
        <source>%1 control points, %2 of them for checks only</source>
        <translation>%1 Passpunkte, davon %2 nur zur Kontrolle</translation>
    </message>
    <message>
        <source>%1 control point, %2 of them for checks only</source>
        <translation>%1 Passpunkt, davon %2 nur zur Kontrolle</translation>
    </message>
    <message>
        <source>readings of a total station</source>
        <translation>Ablesungen eines Tachymeters</translation>
    </message>
    <message>
        <source>run %1: images (images.txt with its pictures, or a video)</source>
        <translation>Fahrt %1: Bilder (images.txt mit den Bildern, oder ein Video)</translation>
    </message>
    <message>
        <source>run %1: camchain.yaml, the camera&apos;s calibration</source>
        <translation>Fahrt %1: camchain.yaml, die Kalibrierung der Kamera</translation>
    </message>
    <message>
        <source>run %1: camchain.yaml: without it the lens is estimated from the images, with less accuracy</source>
        <translation>Fahrt %1: camchain.yaml: ohne sie wird das Objektiv aus den Bildern geschätzt, mit geringerer Genauigkeit</translation>
    </message>
    <message>
        <source>run %1: odometry.tum: without it the motion is estimated from the images alone, and its scale from GPS or geotagged panoramas</source>
        <translation>Fahrt %1: odometry.tum: ohne sie wird die Bewegung aus den Bildern allein geschätzt, der Maßstab aus GPS oder Panoramen mit Geotag</translation>
    </message>
    <message>
        <source>%1 geotagged photo</source>
        <translation>%1 Foto mit Geotag</translation>
    </message>
    <message>
        <source>%1 geotagged photos</source>
        <translation>%1 Fotos mit Geotag</translation>
    </message>
    <message>
        <source>%1 hand-held photo set</source>
        <translation>%1 Fotosatz aus der Hand</translation>
    </message>
    <message>
        <source>%1 hand-held photo sets</source>
        <translation>%1 Fotosätze aus der Hand</translation>
    </message>
    <message>
        <source>tags of family %1</source>
        <translation>Marken der Familie %1</translation>
    </message>
    <message>
        <source>tags of family %1, %2</source>
        <translation>Marken der Familie %1, %2</translation>
    </message>
    <message>
        <source>aerial image %1</source>
        <translation>Luftbild %1</translation>
    </message>
    <message>
        <source>origin %1, %2, %3 (%4)</source>
        <translation>Ursprung %1, %2, %3 (%4)</translation>
    </message>
    <message>
        <source>runs: runs/&lt;run&gt;/ with images.txt, camchain.yaml, odometry.tum</source>
        <translation>Fahrten: runs/&lt;Fahrt&gt;/ mit images.txt, camchain.yaml, odometry.tum</translation>
    </message>
    <message>
        <source>panoramas (panoramas.csv), geotagged photos (photos.csv) or photo sets (photos/&lt;set&gt;/): without them `localize` gives only each run&apos;s own frame</source>
        <translation>Panoramen (panoramas.csv), Fotos mit Geotag (photos.csv) oder Fotosätze (photos/&lt;Satz&gt;/): ohne sie gibt `localize` nur das eigene System jeder Fahrt</translation>
    </message>
    <message>
        <source>positions of the panoramas: without them the results are not georeferenced</source>
        <translation>Positionen der Panoramen: ohne sie sind die Resultate nicht georeferenziert</translation>
    </message>
    <message>
        <source>an origin: no control point, panorama or GPS fix georeferences this site</source>
        <translation>ein Ursprung: kein Passpunkt, kein Panorama und keine GPS-Position georeferenziert dieses Messgebiet</translation>
    </message>
    <message>
        <source>stations.csv and tags.yaml: `evaluate` needs tags at the stations as ground truth</source>
        <translation>stations.csv und tags.yaml: `evaluate` braucht Marken an den Stationen als Referenz</translation>
    </message>
    <message>
        <source>%1 of the set %2, to be stitched: %3</source>
        <translation>%1 des Satzes %2, zusammenzusetzen: %3</translation>
    </message>
    <message>
        <source>%1 by %2</source>
        <translation>%1 von %2</translation>
    </message>
    <message>
        <source>others: refused or no match</source>
        <translation>andere: abgelehnt oder nicht zugeordnet</translation>
    </message>
    <message>
        <source>median of %1</source>
        <translation>Median von %1</translation>
    </message>
    <message>
        <source>worst %1</source>
        <translation>größter %1</translation>
    </message>
    <message>
        <source>1 sigma (standard deviation) of the largest axis, median over the answers</source>
        <translation>1 Sigma (Standardabweichung) der größten Achse, Median über die Antworten</translation>
    </message>
    <message>
        <source>not tested here</source>
        <translation>hier nicht geprüft</translation>
    </message>
    <message>
        <source>sigma: standard deviation</source>
        <translation>Sigma: Standardabweichung</translation>
    </message>
    <message>
        <source>ANEES (mean squared error over variance) %1, right: %2 to %3</source>
        <translation>ANEES (mittlerer quadratischer Fehler durch Varianz) %1, richtig: %2 bis %3</translation>
    </message>
    <message>
        <source>An answer is the pose of a whole panorama (G2)</source>
        <translation>Eine Antwort ist die Pose eines ganzen Panoramas (G2)</translation>
    </message>
    <message>
        <source>it is compared with AprilTags at %1</source>
        <translation>sie wird verglichen mit AprilTags an: %1</translation>
    </message>
    <message>
        <source>Arrows: from the reference to the answer, horizontally, %1</source>
        <translation>Pfeile: von der Referenz zur Antwort, horizontal, %1</translation>
    </message>
    <message>
        <source>dashed ellipses: 95 % of the difference at the same scale</source>
        <translation>gestrichelte Ellipsen: 95 % der Differenz im selben Maßstab</translation>
    </message>
    <message>
        <source>Arrows: map minus stated, horizontally, %1</source>
        <translation>Pfeile: Karte minus Sollwert, horizontal, %1</translation>
    </message>
    <message>
        <source>dashed: the ellipse in which 95 % of such differences lie if all sigmas are right, at the same scale</source>
        <translation>gestrichelt: die Ellipse, in der 95 % solcher Differenzen liegen, wenn alle Sigmas stimmen, im selben Maßstab</translation>
    </message>
    <message>
        <source>Plan, north up</source>
        <translation>Plan, Norden oben</translation>
    </message>
    <message>
        <source>east and north in %1 (%2)</source>
        <translation>Ost und Nord in %1 (%2)</translation>
    </message>
    <message>
        <source>Rows are taken as independent</source>
        <translation>Zeilen gelten als unabhängig</translation>
    </message>
    <message>
        <source>few answers give coarse steps</source>
        <translation>wenige Antworten geben grobe Stufen</translation>
    </message>
    <message>
        <source>shared evidence</source>
        <translation>gemeinsame Daten</translation>
    </message>
    <message>
        <source>%1 points of the run fit the best pose, %2 needed</source>
        <translation>%1 Punkte der Fahrt passen zur besten Pose, %2 sind nötig</translation>
    </message>
    <message>
        <source>tag %1 has no pose in reference %2</source>
        <translation>Marke %1 hat keine Pose in der Referenz %2</translation>
    </message>
    <message>
        <source>station %1 is not in stations.csv</source>
        <translation>Station %1 steht nicht in stations.csv</translation>
    </message>
    <message>
        <source>station</source>
        <translation>Station</translation>
    </message>
    <message>
        <source>tag</source>
        <translation>Marke</translation>
    </message>
    <message>
        <source>cameras, optimised</source>
        <translation>Kameras, optimiert</translation>
    </message>
    <message>
        <source>odometry, begun at the first camera</source>
        <translation>Odometrie, von der ersten Kamera an</translation>
    </message>
    <message>
        <source>truth</source>
        <translation>Wahrheit</translation>
    </message>
    <message>
        <source>reference poses from the tag map</source>
        <translation>Referenzposen aus der Markenkarte</translation>
    </message>
    <message>
        <source>other systems, fitted rigidly</source>
        <translation>andere Systeme, starr eingepasst</translation>
    </message>
    <message>
        <source>geotags of panoramas</source>
        <translation>Geotags der Panoramen</translation>
    </message>
    <message>
        <source>errors x %1</source>
        <translation>Fehler x %1</translation>
    </message>
    <message>
        <source>ellipsoids of errors, %1 %, x %2</source>
        <translation>Ellipsoide der Fehler, %1 %, x %2</translation>
    </message>
    <message>
        <source>ellipsoids of tags, %1 %, x %2</source>
        <translation>Ellipsoide der Marken, %1 %, x %2</translation>
    </message>
    <message>
        <source>ellipsoids of cameras, %1 %, x %2</source>
        <translation>Ellipsoide der Kameras, %1 %, x %2</translation>
    </message>
    <message>
        <source>control (full), check (open)</source>
        <translation>Passpunkte (voll), Kontrollpunkte (offen)</translation>
    </message>
    <message>
        <source>map minus stated x %1</source>
        <translation>Karte minus Sollwert x %1</translation>
    </message>
    <message>
        <source>height (%1)</source>
        <translation>Höhe (%1)</translation>
    </message>
    <message>
        <source>height, %1</source>
        <translation>Höhe, %1</translation>
    </message>
    <message>
        <source>images</source>
        <translation>Bilder</translation>
    </message>
    <message>
        <source>images, %1</source>
        <translation>Bilder, %1</translation>
    </message>
    <message>
        <source>sigma (%1)</source>
        <translation>Sigma (%1)</translation>
    </message>
    <message>
        <source>sigma, %1</source>
        <translation>Sigma, %1</translation>
    </message>
    <message>
        <source>residual, %1</source>
        <translation>Residuum, %1</translation>
    </message>
    <message>
        <source>residual (px)</source>
        <translation>Residuum (px)</translation>
    </message>
</context>
<context>
    <name>main</name>
    <message>
        <source>Trigpoint&apos;s workstation.</source>
        <translation>Der Arbeitsplatz von Trigpoint.</translation>
    </message>
    <message>
        <source>the project; default: that of the last session</source>
        <translation>das Projekt; Vorgabe: das der letzten Sitzung</translation>
    </message>
</context>
<context>
    <name>trigpoint::Action</name>
    <message>
        <source>Export</source>
        <translation>Export</translation>
    </message>
    <message>
        <source>Results as files of other programs: maps, models, pose graphs. Files of others are never replaced.</source>
        <translation>Ergebnisse als Dateien anderer Programme: Karten, Modelle, Posengraphen. Fremde Dateien werden nie ersetzt.</translation>
    </message>
    <message>
        <source>Publish</source>
        <translation>Veröffentlichen</translation>
    </message>
    <message>
        <source>Freezes map, tables and all they were computed from under a name. A release is never overwritten; what is out of date is not published.</source>
        <translation>Hält Karte, Tabellen und alles, woraus sie berechnet wurden, unter einem Namen fest. Eine Veröffentlichung wird nie überschrieben; Veraltetes wird nicht veröffentlicht.</translation>
    </message>
    <message>
        <source>Import</source>
        <translation>Importieren</translation>
    </message>
    <message>
        <source>Other people&apos;s data as new files of this project. Nothing that is there is replaced.</source>
        <translation>Daten anderer als neue Dateien dieses Projekts. Nichts Vorhandenes wird ersetzt.</translation>
    </message>
</context>
<context>
    <name>trigpoint::ActionDialog</name>
    <message>
        <source>Options</source>
        <translation>Optionen</translation>
    </message>
    <message>
        <source>Equivalent command line</source>
        <translation>Gleichwertige Befehlszeile</translation>
    </message>
    <message>
        <source>Result</source>
        <translation>Ergebnis</translation>
    </message>
    <message>
        <source>Cancel</source>
        <translation>Abbrechen</translation>
    </message>
    <message>
        <source>Close</source>
        <translation>Schließen</translation>
    </message>
    <message>
        <source>Working ...</source>
        <translation>In Arbeit ...</translation>
    </message>
    <message>
        <source>Done.</source>
        <translation>Fertig.</translation>
    </message>
    <message>
        <source>Not done.</source>
        <translation>Nicht ausgeführt.</translation>
    </message>
</context>
<context>
    <name>trigpoint::CalibrationDesk</name>
    <message>
        <source>Calibration</source>
        <translation>Kalibrierung</translation>
    </message>
    <message>
        <source>Camera</source>
        <translation>Kamera</translation>
    </message>
    <message>
        <source>Residuals over the image</source>
        <translation>Residuen über dem Bild</translation>
    </message>
    <message>
        <source>Points in each part of the image</source>
        <translation>Punkte in jedem Teil des Bildes</translation>
    </message>
    <message>
        <source>Uncertainty over the image</source>
        <translation>Unsicherheit über dem Bild</translation>
    </message>
    <message>
        <source>Parameters</source>
        <translation>Parameter</translation>
    </message>
    <message>
        <source>parameter</source>
        <translation>Parameter</translation>
    </message>
    <message>
        <source>value</source>
        <translation>Wert</translation>
    </message>
    <message>
        <source>1 sigma</source>
        <translation>1 Sigma</translation>
    </message>
    <message>
        <source>Calibra&amp;te ...</source>
        <translation>Kalibrie&amp;ren ...</translation>
    </message>
    <message>
        <source>%1, %2 x %3 px, %4 of %5 pictures used, residual RMS %6 px (how well the model fits, not how accurate it is)</source>
        <translation>%1, %2 x %3 px, %4 von %5 Bildern verwendet, RMS der Residuen %6 px (das sagt, wie gut das Modell passt, nicht, wie genau es ist)</translation>
    </message>
    <message>
        <source>What to photograph next</source>
        <translation>Was als Nächstes zu fotografieren ist</translation>
    </message>
    <message>
        <source>Every part of the image has points.</source>
        <translation>In jedem Teil des Bildes sind Punkte.</translation>
    </message>
    <message>
        <source>points, mean residual</source>
        <translation>Punkte, mittleres Residuum</translation>
    </message>
    <message>
        <source>residuals, %1 x</source>
        <translation>Residuen, %1-fach</translation>
    </message>
    <message>
        <source>uncertainty</source>
        <translation>Unsicherheit</translation>
    </message>
    <message>
        <source>parameter of the camera model, as in calibration.json: focal lengths and principal point (px), distortion (without unit)</source>
        <translation>Parameter des Kameramodells wie in calibration.json: Brennweiten und Hauptpunkt (px), Verzeichnung (ohne Einheit)</translation>
    </message>
    <message>
        <source>estimated value, in the parameter&apos;s unit</source>
        <translation>geschätzter Wert in der Einheit des Parameters</translation>
    </message>
    <message>
        <source>1 sigma (standard deviation) of the value, in the parameter&apos;s unit</source>
        <translation>1 Sigma (Standardabweichung) des Werts in der Einheit des Parameters</translation>
    </message>
    <message>
        <source>No calibration yet: press Calibrate, and give the pictures of a board and the board&apos;s target.</source>
        <translation>Noch keine Kalibrierung: Kalibrieren drücken und die Bilder einer Tafel und die Beschreibung der Tafel angeben.</translation>
    </message>
    <message>
        <source>No uncertainty map: run calibrate again to make it.</source>
        <translation>Keine Karte der Unsicherheit: calibrate noch einmal rechnen.</translation>
    </message>
    <message>
        <source>Calibration that is shown</source>
        <translation>Angezeigte Kalibrierung</translation>
    </message>
    <message>
        <source>Camera of the calibration</source>
        <translation>Kamera der Kalibrierung</translation>
    </message>
    <message>
        <source>Which parts of the image have points is drawn here.</source>
        <translation>Hier wird gezeichnet, welche Teile des Bildes Punkte haben.</translation>
    </message>
    <message>
        <source>The residuals over the image are drawn here.</source>
        <translation>Hier werden die Residuen über dem Bild gezeichnet.</translation>
    </message>
    <message>
        <source>The uncertainty over the image is drawn here.</source>
        <translation>Hier wird die Unsicherheit über dem Bild gezeichnet.</translation>
    </message>
    <message>
        <source>Open a project (Ctrl+O) to see its calibrations.</source>
        <translation>Ein Projekt öffnen (Strg+O), um seine Kalibrierungen zu sehen.</translation>
    </message>
</context>
<context>
    <name>trigpoint::ChartsDesk</name>
    <message>
        <source>Charts</source>
        <translation>Diagramme</translation>
    </message>
    <message>
        <source>Chart</source>
        <translation>Diagramm</translation>
    </message>
    <message>
        <source>&amp;Save chart ...</source>
        <translation>Diagramm &amp;speichern ...</translation>
    </message>
    <message>
        <source>The chart as PNG; the report has all of them as SVG, too</source>
        <translation>Das Diagramm als PNG; der Bericht enthält alle auch als SVG</translation>
    </message>
    <message>
        <source>Drawing ...</source>
        <translation>Wird gezeichnet ...</translation>
    </message>
    <message>
        <source>The charts are not shown.</source>
        <translation>Die Diagramme werden nicht gezeigt.</translation>
    </message>
    <message>
        <source>No chart yet: run evaluate, then they are drawn here as in the report.</source>
        <translation>Noch kein Diagramm: evaluate ausführen, dann werden sie hier wie im Bericht gezeichnet.</translation>
    </message>
    <message>
        <source>Save the chart</source>
        <translation>Diagramm speichern</translation>
    </message>
    <message>
        <source>PNG (*.png)</source>
        <translation>PNG (*.png)</translation>
    </message>
    <message>
        <source>%1: cannot be written</source>
        <translation>%1: kann nicht geschrieben werden</translation>
    </message>
    <message>
        <source>In this bar: %1</source>
        <translation>In diesem Balken: %1</translation>
    </message>
    <message>
        <source>These have the largest values; %1 more are not listed.</source>
        <translation>Diese haben die größten Werte; %1 weitere sind nicht aufgeführt.</translation>
    </message>
</context>
<context>
    <name>trigpoint::CheckDesk</name>
    <message>
        <source>&amp;Check now</source>
        <translation>Jetzt &amp;prüfen</translation>
    </message>
    <message>
        <source>Look once at every picture that is there (trigpoint check)</source>
        <translation>Jedes vorhandene Bild einmal ansehen (trigpoint check)</translation>
    </message>
    <message>
        <source>&amp;Watch</source>
        <translation>&amp;Beobachten</translation>
    </message>
    <message>
        <source>Go on as pictures are copied here (trigpoint check --watch)</source>
        <translation>Weitermachen, während Bilder hierher kopiert werden (trigpoint check --watch)</translation>
    </message>
    <message>
        <source>S&amp;top</source>
        <translation>&amp;Anhalten</translation>
    </message>
    <message>
        <source>What was looked at is kept; a later check goes on there</source>
        <translation>Was angesehen wurde, bleibt; eine spätere Prüfung macht dort weiter</translation>
    </message>
    <message>
        <source>Open the &amp;page</source>
        <translation>&amp;Seite öffnen</translation>
    </message>
    <message>
        <source>results/check/index.html in the browser</source>
        <translation>results/check/index.html im Browser</translation>
    </message>
    <message>
        <source>What to do next</source>
        <translation>Was als Nächstes zu tun ist</translation>
    </message>
    <message>
        <source>what to do next</source>
        <translation>als Nächstes zu tun</translation>
    </message>
    <message>
        <source>why</source>
        <translation>Grund</translation>
    </message>
    <message>
        <source>Findings</source>
        <translation>Befunde</translation>
    </message>
    <message>
        <source>light</source>
        <translation>Ampel</translation>
    </message>
    <message>
        <source>topic</source>
        <translation>Thema</translation>
    </message>
    <message>
        <source>finding</source>
        <translation>Befund</translation>
    </message>
    <message>
        <source>Tags</source>
        <translation>Marken</translation>
    </message>
    <message>
        <source>tag</source>
        <translation>Marke</translation>
    </message>
    <message>
        <source>status</source>
        <translation>Status</translation>
    </message>
    <message>
        <source>pictures</source>
        <translation>Bilder</translation>
    </message>
    <message>
        <source>largest (px)</source>
        <translation>größte (px)</translation>
    </message>
    <message>
        <source>nearest</source>
        <translation>nächstes</translation>
    </message>
    <message>
        <source>from (deg)</source>
        <translation>von (Grad)</translation>
    </message>
    <message>
        <source>to (deg)</source>
        <translation>bis (Grad)</translation>
    </message>
    <message>
        <source>3D sigma (mm)</source>
        <translation>3D-Sigma (mm)</translation>
    </message>
    <message>
        <source>there for</source>
        <translation>gebraucht für</translation>
    </message>
    <message>
        <source>id</source>
        <translation>Nummer</translation>
    </message>
    <message>
        <source>of the tag in the map</source>
        <translation>der Marke in der Karte</translation>
    </message>
    <message>
        <source>that show it</source>
        <translation>die sie zeigen</translation>
    </message>
    <message>
        <source>its longest side in any of them</source>
        <translation>ihre längste Seite in einem davon</translation>
    </message>
    <message>
        <source>distance of the nearest of them</source>
        <translation>Abstand des nächsten davon</translation>
    </message>
    <message>
        <source>leftmost direction that the tag was photographed from, as an angle from its normal, for a viewer who faces the tag</source>
        <translation>am weitesten links liegende Richtung eines Bildes, von der Normalen der Marke aus, ihr gegenüber</translation>
    </message>
    <message>
        <source>rightmost direction that the tag was photographed from, as an angle from its normal, for a viewer who faces the tag</source>
        <translation>am weitesten rechts liegende Richtung eines Bildes, von der Normalen der Marke aus, ihr gegenüber</translation>
    </message>
    <message>
        <source>predicted, 1 sigma</source>
        <translation>vorhergesagt, 1 Sigma</translation>
    </message>
    <message>
        <source>what the tag is needed for</source>
        <translation>wofür die Marke gebraucht wird</translation>
    </message>
    <message>
        <source>Map of the check</source>
        <translation>Karte der Prüfung</translation>
    </message>
    <message>
        <source>Not watched any more.</source>
        <translation>Wird nicht mehr beobachtet.</translation>
    </message>
    <message>
        <source>Done.</source>
        <translation>Fertig.</translation>
    </message>
    <message>
        <source>The folder was not checked.</source>
        <translation>Der Ordner wurde nicht geprüft.</translation>
    </message>
    <message>
        <source>Looking ...</source>
        <translation>Wird angesehen ...</translation>
    </message>
    <message>
        <source>Stopping ...</source>
        <translation>Wird angehalten ...</translation>
    </message>
    <message>
        <source>No program opens the page: %1</source>
        <translation>Kein Programm öffnet die Seite: %1</translation>
    </message>
    <message>
        <source>Do the recordings suffice? Watch this folder while pictures are copied into it, or check it once, before you leave the site.</source>
        <translation>Reichen die Aufnahmen? Diesen Ordner beobachten, während Bilder hineinkopiert werden, oder ihn einmal prüfen, bevor man den Ort verlässt.</translation>
    </message>
    <message>
        <source>Open the folder that the camera&apos;s pictures are copied to.</source>
        <translation>Den Ordner öffnen, in den die Bilder der Kamera kopiert werden.</translation>
    </message>
    <message>
        <source>The map of the tags and of where to stand next is drawn here.</source>
        <translation>Hier wird die Karte der Marken und des nächsten Standorts gezeichnet.</translation>
    </message>
    <message>
        <source>tags, the way so far, where to stand next</source>
        <translation>Marken, der bisherige Weg, der nächste Standort</translation>
    </message>
    <message>
        <source>No map yet: too few tags were seen.</source>
        <translation>Noch keine Karte: zu wenige Marken wurden gesehen.</translation>
    </message>
    <message>
        <source>nearest (%1)</source>
        <translation>nächstes (%1)</translation>
    </message>
    <message>
        <source>not planned</source>
        <translation>nicht geplant</translation>
    </message>
    <message>
        <source>what helps most comes first</source>
        <translation>was am meisten hilft, steht vorn</translation>
    </message>
    <message>
        <source>what is missing, or what it improves</source>
        <translation>was fehlt oder was es verbessert</translation>
    </message>
    <message>
        <source>red: the recordings do not suffice yet; amber: look at it before you leave; green: no problem found</source>
        <translation>rot: die Aufnahmen genügen noch nicht; gelb: vor dem Weggehen ansehen; grün: kein Problem gefunden</translation>
    </message>
    <message>
        <source>what was looked at</source>
        <translation>was geprüft wurde</translation>
    </message>
    <message>
        <source>what was found</source>
        <translation>was gefunden wurde</translation>
    </message>
</context>
<context>
    <name>trigpoint::CompareDesk</name>
    <message>
        <source>First evaluation</source>
        <translation>Erste Auswertung</translation>
    </message>
    <message>
        <source>Second evaluation</source>
        <translation>Zweite Auswertung</translation>
    </message>
    <message>
        <source>Run of the first</source>
        <translation>Fahrt der ersten</translation>
    </message>
    <message>
        <source>Run of the second</source>
        <translation>Fahrt der zweiten</translation>
    </message>
    <message>
        <source>Other &amp;project or release ...</source>
        <translation>Anderes &amp;Projekt oder Veröffentlichung ...</translation>
    </message>
    <message>
        <source>Errors side by side</source>
        <translation>Fehler nebeneinander</translation>
    </message>
    <message>
        <source>What changed in inputs, options and version</source>
        <translation>Was sich an Eingaben, Optionen und Version geändert hat</translation>
    </message>
    <message>
        <source>Paired comparison</source>
        <translation>Paarweiser Vergleich</translation>
    </message>
    <message>
        <source>Station by station</source>
        <translation>Station für Station</translation>
    </message>
    <message>
        <source>Paired statistics</source>
        <translation>Paarweise Statistik</translation>
    </message>
    <message>
        <source>What changed</source>
        <translation>Was sich geändert hat</translation>
    </message>
    <message>
        <source>3D</source>
        <translation>3D</translation>
    </message>
    <message>
        <source>A project, a release, or a folder of errors.csv</source>
        <translation>Ein Projekt, eine Veröffentlichung oder ein Ordner mit errors.csv</translation>
    </message>
    <message>
        <source>%1: found no errors.csv there, nor in results/evaluate</source>
        <translation>%1: keine errors.csv gefunden, weder dort noch in results/evaluate</translation>
    </message>
    <message>
        <source>first results</source>
        <translation>erste Ergebnisse</translation>
    </message>
    <message>
        <source>release %1</source>
        <translation>Veröffentlichung %1</translation>
    </message>
    <message>
        <source>all runs</source>
        <translation>alle Fahrten</translation>
    </message>
    <message>
        <source>Nothing to compare yet: no evaluation is there. Run evaluate first.</source>
        <translation>Noch nichts zu vergleichen: Es gibt keine Auswertung. Zuerst evaluate ausführen.</translation>
    </message>
    <message>
        <source>One side is %1 alone: of the other side&apos;s runs only %1 is compared.</source>
        <translation>Auf einer Seite steht nur %1: Von den Fahrten der anderen Seite wird nur %1 verglichen.</translation>
    </message>
    <message>
        <source>A and B are the same results: choose another variant, run, release or project for B.</source>
        <translation>A und B sind dieselben Ergebnisse: für B eine andere Variante, eine andere Fahrt, eine Veröffentlichung oder ein anderes Projekt wählen.</translation>
    </message>
    <message>
        <source>Comparing ...</source>
        <translation>Vergleich läuft ...</translation>
    </message>
    <message>
        <source>A and B have no panorama in common that both evaluate.</source>
        <translation>A und B haben kein Panorama gemeinsam, das beide auswerten.</translation>
    </message>
    <message>
        <source>what changed from A to B</source>
        <translation>was sich von A nach B geändert hat</translation>
    </message>
    <message>
        <source>nothing: options, inputs and versions are the same</source>
        <translation>nichts: Optionen, Eingaben und Versionen sind dieselben</translation>
    </message>
    <message>
        <source>reference</source>
        <translation>Referenz</translation>
    </message>
    <message>
        <source>answer</source>
        <translation>Antwort</translation>
    </message>
    <message>
        <source>run</source>
        <translation>Fahrt</translation>
    </message>
    <message>
        <source>station</source>
        <translation>Station</translation>
    </message>
    <message>
        <source>panorama</source>
        <translation>Panorama</translation>
    </message>
    <message>
        <source>B - A (%1)</source>
        <translation>B - A (%1)</translation>
    </message>
    <message>
        <source>%1 (has errors only, no results to draw)</source>
        <translation>%1 (nur Fehler, keine Ergebnisse zum Zeichnen)</translation>
    </message>
    <message>
        <source>inputs, options and versions of the results that differ</source>
        <translation>Eingaben, Optionen und Versionen der Ergebnisse, die sich unterscheiden</translation>
    </message>
    <message>
        <source>what the answers are compared with</source>
        <translation>womit die Antworten verglichen werden</translation>
    </message>
    <message>
        <source>how the answer was made: panorama (G2) or view (G1)</source>
        <translation>wie die Antwort entstand: Panorama (G2) oder Ansicht (G1)</translation>
    </message>
    <message>
        <source>run that the panorama was localized against</source>
        <translation>Lauf, in dem das Panorama lokalisiert wurde</translation>
    </message>
    <message>
        <source>station at which the panorama was taken</source>
        <translation>Station, an der das Panorama aufgenommen wurde</translation>
    </message>
    <message>
        <source>panorama, photo or photo set</source>
        <translation>Panorama, Foto oder Fotosatz</translation>
    </message>
    <message>
        <source>distance in space between the answer of A and the reference (%1)</source>
        <translation>räumlicher Abstand zwischen der Antwort von A und der Referenz (%1)</translation>
    </message>
    <message>
        <source>distance in space between the answer of B and the reference (%1)</source>
        <translation>räumlicher Abstand zwischen der Antwort von B und der Referenz (%1)</translation>
    </message>
    <message>
        <source>error of B minus error of A: negative where B is better (%1)</source>
        <translation>Fehler von B minus Fehler von A: negativ, wo B besser ist (%1)</translation>
    </message>
    <message>
        <source>Results of a variant, of a release, or of another project</source>
        <translation>Ergebnisse einer Variante, einer Veröffentlichung oder eines anderen Projekts</translation>
    </message>
    <message>
        <source>All runs, or the one whose answers are compared</source>
        <translation>Alle Fahrten oder die, deren Antworten verglichen werden</translation>
    </message>
    <message>
        <source>A folder with another project, a release, or errors.csv: becomes B</source>
        <translation>Ein Ordner mit einem anderen Projekt, einer Veröffentlichung oder errors.csv: wird B</translation>
    </message>
    <message>
        <source>Open a project (Ctrl+O) to compare its variants, runs and releases.</source>
        <translation>Ein Projekt öffnen (Strg+O), um seine Varianten, Fahrten und Veröffentlichungen zu vergleichen.</translation>
    </message>
    <message>
        <source>standard deviation of the error in space, the larger one of A and B (%1)</source>
        <translation>Standardabweichung des räumlichen Fehlers, die größere von A und B (%1)</translation>
    </message>
    <message>
        <source>localized, refused, no match or no reference: in A, then in B</source>
        <translation>lokalisiert, abgelehnt, nicht zugeordnet oder ohne Referenz: in A, dann in B</translation>
    </message>
    <message>
        <source>status</source>
        <translation>Status</translation>
    </message>
</context>
<context>
    <name>trigpoint::Decisions</name>
    <message>
        <source>make %1 a %2 point</source>
        <translation>%1 die Rolle %2 geben</translation>
    </message>
    <message>
        <source>exclude %1</source>
        <translation>%1 ausschließen</translation>
    </message>
    <message>
        <source>restore %1</source>
        <translation>%1 wieder aufnehmen</translation>
    </message>
    <message>
        <source>taken back</source>
        <translation>zurückgenommen</translation>
    </message>
    <message>
        <source>A decision needs a reason: write it beside &apos;Reason&apos;.</source>
        <translation>Eine Entscheidung braucht einen Grund: bei „Grund“ eintragen.</translation>
    </message>
    <message>
        <source>Nothing was written to review.jsonl.</source>
        <translation>In review.jsonl wurde nichts geschrieben.</translation>
    </message>
    <message>
        <source>excluded by mistake</source>
        <translation>irrtümlich ausgeschlossen</translation>
    </message>
    <message>
        <source>put right since</source>
        <translation>inzwischen berichtigt</translation>
    </message>
    <message>
        <source>held back to check the map</source>
        <translation>zur Prüfung der Karte zurückgehalten</translation>
    </message>
    <message>
        <source>needed to hold the map</source>
        <translation>zum Halten der Karte gebraucht</translation>
    </message>
    <message>
        <source>half hidden</source>
        <translation>halb verdeckt</translation>
    </message>
    <message>
        <source>blurred</source>
        <translation>unscharf</translation>
    </message>
    <message>
        <source>a reflection</source>
        <translation>eine Spiegelung</translation>
    </message>
    <message>
        <source>another tag&apos;s id</source>
        <translation>die Nummer einer anderen Marke</translation>
    </message>
    <message>
        <source>badly exposed</source>
        <translation>schlecht belichtet</translation>
    </message>
    <message>
        <source>the lens was covered</source>
        <translation>das Objektiv war verdeckt</translation>
    </message>
    <message>
        <source>stitched badly</source>
        <translation>schlecht zusammengesetzt</translation>
    </message>
    <message>
        <source>taken elsewhere</source>
        <translation>anderswo aufgenommen</translation>
    </message>
    <message>
        <source>was moved</source>
        <translation>wurde bewegt</translation>
    </message>
    <message>
        <source>damaged</source>
        <translation>beschädigt</translation>
    </message>
    <message>
        <source>surveyed badly</source>
        <translation>schlecht eingemessen</translation>
    </message>
    <message>
        <source>Reason</source>
        <translation>Grund</translation>
    </message>
    <message>
        <source>Reason of the decision; it is stored in review.jsonl.</source>
        <translation>Grund der Entscheidung; er wird in review.jsonl gespeichert.</translation>
    </message>
    <message>
        <source>Exclude %1</source>
        <translation>%1 ausschließen</translation>
    </message>
    <message>
        <source>Restore %1</source>
        <translation>%1 wieder aufnehmen</translation>
    </message>
    <message>
        <source>Change the role of %1</source>
        <translation>Rolle von %1 ändern</translation>
    </message>
    <message>
        <source>Another reason ...</source>
        <translation>Anderer Grund ...</translation>
    </message>
    <message>
        <source>excluded by the review: %1</source>
        <translation>durch die Prüfung ausgeschlossen: %1</translation>
    </message>
    <message>
        <source>; solve again to see its effect</source>
        <translation>; neu lösen, um die Wirkung zu sehen</translation>
    </message>
</context>
<context>
    <name>trigpoint::HelpDialog</name>
    <message>
        <source>Keys and terms</source>
        <translation>Tasten und Begriffe</translation>
    </message>
    <message>
        <source>Wheel, + and -</source>
        <translation>Rad, + und -</translation>
    </message>
    <message>
        <source>pictures, charts and scene: zoom to the mouse</source>
        <translation>Bilder, Diagramme und Szene: an der Maus vergrößern</translation>
    </message>
    <message>
        <source>Drag, arrow keys</source>
        <translation>Ziehen, Pfeiltasten</translation>
    </message>
    <message>
        <source>pictures: move; scene: turn, in the plan move</source>
        <translation>Bilder: verschieben; Szene: drehen, im Plan verschieben</translation>
    </message>
    <message>
        <source>pictures: fit; pixel by pixel</source>
        <translation>Bilder: einpassen; Pixel für Pixel</translation>
    </message>
    <message>
        <source>Home, F</source>
        <translation>Pos1, F</translation>
    </message>
    <message>
        <source>scene: all; the selection</source>
        <translation>Szene: alles; die Auswahl</translation>
    </message>
    <message>
        <source>Page Up, Page Down, Escape</source>
        <translation>Bild auf, Bild ab, Esc</translation>
    </message>
    <message>
        <source>inside a panorama: the run&apos;s others; leave</source>
        <translation>in einem Panorama: die anderen der Fahrt; verlassen</translation>
    </message>
    <message>
        <source>scene: copy the coordinates under the mouse; tables: copy the rows</source>
        <translation>Szene: Koordinaten unter der Maus kopieren; Tabellen: Zeilen kopieren</translation>
    </message>
    <message>
        <source>Ctrl+N</source>
        <translation>Strg+N</translation>
    </message>
    <message>
        <source>images: the next image of the selected tag</source>
        <translation>Bilder: das nächste Bild der gewählten Marke</translation>
    </message>
    <message>
        <source>Right click</source>
        <translation>Rechtsklick</translation>
    </message>
    <message>
        <source>any station, tag, image, detection, panorama, point: show it, exclude it, restore it</source>
        <translation>Station, Marke, Bild, Detektion, Panorama, Punkt: zeigen, ausschließen, wieder aufnehmen</translation>
    </message>
    <message>
        <source>Double click, Enter</source>
        <translation>Doppelklick, Eingabe</translation>
    </message>
    <message>
        <source>show it: the image that sees it best</source>
        <translation>zeigen: das Bild, das es am besten sieht</translation>
    </message>
    <message>
        <source>station</source>
        <translation>Station</translation>
    </message>
    <message>
        <source>a place with a tag and a panorama, whose position is known or surveyed</source>
        <translation>ein Ort mit Marke und Panorama, dessen Lage bekannt oder eingemessen ist</translation>
    </message>
    <message>
        <source>panorama (G2)</source>
        <translation>Panorama (G2)</translation>
    </message>
    <message>
        <source>one pose for a whole panorama: the final answer</source>
        <translation>eine Pose für das ganze Panorama: die endgültige Antwort</translation>
    </message>
    <message>
        <source>view (G1)</source>
        <translation>Ansicht (G1)</translation>
    </message>
    <message>
        <source>one pose for each rectilinear view of a panorama by itself</source>
        <translation>je eine Pose für jede geradlinige Ansicht eines Panoramas</translation>
    </message>
    <message>
        <source>relative</source>
        <translation>relativ</translation>
    </message>
    <message>
        <source>compared in the run&apos;s own frame, with tags that the same cameras saw</source>
        <translation>im eigenen System der Fahrt verglichen, mit Marken, die dieselben Kameras sahen</translation>
    </message>
    <message>
        <source>absolute</source>
        <translation>absolut</translation>
    </message>
    <message>
        <source>compared in site coordinates: the georeference&apos;s error is part of it</source>
        <translation>in Koordinaten des Messgebiets verglichen: der Fehler der Georeferenz ist enthalten</translation>
    </message>
    <message>
        <source>answer minus reference, east, north, up</source>
        <translation>Antwort minus Referenz, Ost, Nord, oben</translation>
    </message>
    <message>
        <source>1 sigma, of the difference where an error stands beside it</source>
        <translation>1 Sigma, der Differenz, wo ein Fehler daneben steht</translation>
    </message>
    <message>
        <source>squared error in units of its own covariance; by degree of freedom about 1 if the sigmas are right</source>
        <translation>quadrierter Fehler in Einheiten der eigenen Kovarianz; je Freiheitsgrad etwa 1, wenn die Sigmas stimmen</translation>
    </message>
    <message>
        <source>within</source>
        <translation>innerhalb</translation>
    </message>
    <message>
        <source>the narrowest tolerance of 0.1, 0.25, 0.5 and 1 m that holds the error; the colours show it</source>
        <translation>die engste Toleranz von 0,1, 0,25, 0,5 und 1 m, die der Fehler einhält; die Farben zeigen sie</translation>
    </message>
    <message>
        <source>control, check</source>
        <translation>Passpunkt, Kontrollpunkt</translation>
    </message>
    <message>
        <source>a surveyed point that the map is fitted to; one that only tests it</source>
        <translation>ein eingemessener Punkt, an den die Karte angepasst wird; einer, der sie nur prüft</translation>
    </message>
    <message>
        <source>detection</source>
        <translation>Detektion</translation>
    </message>
    <message>
        <source>one tag found in one image; its residual is the distance of its corners from the map&apos;s</source>
        <translation>eine in einem Bild gefundene Marke; ihr Residuum ist der Abstand ihrer Ecken von denen der Karte</translation>
    </message>
    <message>
        <source>track</source>
        <translation>Spur</translation>
    </message>
    <message>
        <source>a point of the scene as several images see it; lines show reprojection errors ten times as long</source>
        <translation>ein Punkt der Szene, wie ihn mehrere Bilder sehen; Linien zeigen Rückprojektionsfehler zehnfach verlängert</translation>
    </message>
    <message>
        <source>reference trajectory</source>
        <translation>Referenztrajektorie</translation>
    </message>
    <message>
        <source>poses of every image by tag map and odometry, against which cameras are held</source>
        <translation>Posen aller Bilder aus Markenkarte und Odometrie, mit denen Kameras verglichen werden</translation>
    </message>
    <message>
        <source>variant</source>
        <translation>Variante</translation>
    </message>
    <message>
        <source>a second set of results beside the first, with other options</source>
        <translation>ein zweiter Satz von Ergebnissen neben dem ersten, mit anderen Optionen</translation>
    </message>
    <message>
        <source>release</source>
        <translation>Veröffentlichung</translation>
    </message>
    <message>
        <source>a frozen copy of results with all they rest on</source>
        <translation>eine festgehaltene Kopie von Ergebnissen mit allem, worauf sie beruhen</translation>
    </message>
    <message>
        <source>Keys of the menus</source>
        <translation>Tasten der Menüs</translation>
    </message>
    <message>
        <source>Keys and mouse in the views</source>
        <translation>Tasten und Maus in den Ansichten</translation>
    </message>
    <message>
        <source>Terms</source>
        <translation>Begriffe</translation>
    </message>
    <message>
        <source>Shift with T, N, E, S, W</source>
        <translation>Umschalt mit T, N, E, S, W</translation>
    </message>
    <message>
        <source>scene: look from above, north, east, south, west, as by the cube</source>
        <translation>Szene: von oben, Norden, Osten, Süden, Westen sehen, wie mit dem Würfel</translation>
    </message>
</context>
<context>
    <name>trigpoint::ImagesDesk</name>
    <message>
        <source>Run</source>
        <translation>Ausführen</translation>
    </message>
    <message>
        <source>Images of the run</source>
        <translation>Bilder der Fahrt</translation>
    </message>
    <message>
        <source>Image by time</source>
        <translation>Bild nach Zeit</translation>
    </message>
    <message>
        <source>Panorama or photo</source>
        <translation>Panorama oder Foto</translation>
    </message>
    <message>
        <source>&amp;Match</source>
        <translation>&amp;Zuordnen</translation>
    </message>
    <message>
        <source>Match the image with the panorama, and judge the matches by the solution</source>
        <translation>Das Bild dem Panorama zuordnen und die Zuordnungen an der Lösung prüfen</translation>
    </message>
    <message>
        <source>detections</source>
        <translation>Detektionen</translation>
    </message>
    <message>
        <source>tracks, errors x 10</source>
        <translation>Spuren, Fehler x 10</translation>
    </message>
    <message>
        <source>inlier matches</source>
        <translation>richtige Zuordnungen</translation>
    </message>
    <message>
        <source>outlier matches</source>
        <translation>falsche Zuordnungen</translation>
    </message>
    <message>
        <source>Name of the surveyed point</source>
        <translation>Name des eingemessenen Punkts</translation>
    </message>
    <message>
        <source>Mar&amp;k by click</source>
        <translation>Per &amp;Klick markieren</translation>
    </message>
    <message>
        <source>C&amp;onfirm prediction</source>
        <translation>V&amp;orhersage übernehmen</translation>
    </message>
    <message>
        <source>Camera image</source>
        <translation>Kamerabild</translation>
    </message>
    <message>
        <source>Point</source>
        <translation>Punkt</translation>
    </message>
    <message>
        <source>%1, %2 px</source>
        <translation>%1, %2 px</translation>
    </message>
    <message>
        <source>tags: %1, points: %2</source>
        <translation>Marken: %1, Punkte: %2</translation>
    </message>
    <message>
        <source>, reprojection RMS %1 px</source>
        <translation>, RMS der Rückprojektion %1 px</translation>
    </message>
    <message>
        <source>; excluded by the review</source>
        <translation>; durch die Prüfung ausgeschlossen</translation>
    </message>
    <message>
        <source>Matching ...</source>
        <translation>Zuordnung läuft ...</translation>
    </message>
    <message>
        <source>%1 matches, %2 of them within 3 px of their epipolar lines</source>
        <translation>%1 Zuordnungen, %2 davon höchstens 3 px von ihren Epipolarlinien</translation>
    </message>
    <message>
        <source> excluded</source>
        <translation> ausgeschlossen</translation>
    </message>
    <message>
        <source> predicted</source>
        <translation> vorhergesagt</translation>
    </message>
    <message>
        <source>%1 marks, %2 px; it must show in %3 images</source>
        <translation>%1 Marken, %2 px; er muss in %3 Bildern zu sehen sein</translation>
    </message>
    <message>
        <source>Tag %1 was detected in no image.</source>
        <translation>Marke %1 wurde in keinem Bild gefunden.</translation>
    </message>
    <message>
        <source>linked zoom</source>
        <translation>gekoppelter Zoom</translation>
    </message>
    <message>
        <source>Moves the other picture to the same place, by the inlier matches</source>
        <translation>Verschiebt das andere Bild an dieselbe Stelle, anhand der richtigen Zuordnungen</translation>
    </message>
    <message>
        <source>&amp;Next image of the tag</source>
        <translation>&amp;Nächstes Bild der Marke</translation>
    </message>
    <message>
        <source>Ctrl+N</source>
        <translation>Ctrl+N</translation>
    </message>
    <message>
        <source>Goes through all images that show the selected station&apos;s tag (Ctrl+N)</source>
        <translation>Geht durch alle Bilder, die die Marke der gewählten Station zeigen (Strg+N)</translation>
    </message>
    <message>
        <source>Order of the images of a tag</source>
        <translation>Reihenfolge der Bilder einer Marke</translation>
    </message>
    <message>
        <source>worst residual first</source>
        <translation>größtes Residuum zuerst</translation>
    </message>
    <message>
        <source>largest first</source>
        <translation>größte zuerst</translation>
    </message>
    <message>
        <source>The next click in the image marks the point; from two marks on it is predicted elsewhere. A mark is moved by dragging it</source>
        <translation>Der nächste Klick ins Bild markiert den Punkt; ab zwei Markierungen wird er anderswo vorhergesagt. Eine Markierung wird durch Ziehen verschoben</translation>
    </message>
    <message>
        <source>Re&amp;move mark</source>
        <translation>Markierung &amp;entfernen</translation>
    </message>
    <message>
        <source>Take the point&apos;s mark out of this image</source>
        <translation>Die Markierung des Punkts aus diesem Bild nehmen</translation>
    </message>
    <message>
        <source>Remove the mark of %1</source>
        <translation>Markierung von %1 entfernen</translation>
    </message>
    <message>
        <source>, %1 px off</source>
        <translation>, %1 px daneben</translation>
    </message>
    <message>
        <source>Select a station or a tag first.</source>
        <translation>Zuerst eine Station oder Marke wählen.</translation>
    </message>
    <message>
        <source>tag %1: %2 of %3</source>
        <translation>Marke %1: %2 von %3</translation>
    </message>
    <message>
        <source>, residual %1 px</source>
        <translation>, Residuum %1 px</translation>
    </message>
    <message>
        <source>Part of the panorama</source>
        <translation>Teil des Panoramas</translation>
    </message>
    <message>
        <source>whole</source>
        <translation>ganz</translation>
    </message>
    <message>
        <source>Reading the picture ...</source>
        <translation>Das Bild wird gelesen ...</translation>
    </message>
    <message>
        <source>This project has no image. Choose File, Import to import a run, or put the run&apos;s images below the folder runs.</source>
        <translation>Dieses Projekt hat kein Bild. Mit Datei, Importieren einen Lauf importieren oder die Bilder des Laufs in den Ordner runs legen.</translation>
    </message>
    <message>
        <source>No project is open. Drop its folder here, or open it (Ctrl+O).</source>
        <translation>Kein Projekt ist geöffnet. Seinen Ordner hierher ziehen oder ihn öffnen (Strg+O).</translation>
    </message>
    <message>
        <source>%1, view %2: yaw %3, pitch %4, field of view %5</source>
        <translation>%1, Ansicht %2: Gieren %3, Nicken %4, Bildwinkel %5</translation>
    </message>
    <message>
        <source>This project has no panorama. Put panoramas into the folder panoramas, or choose File, Panoramas of services to load some.</source>
        <translation>Dieses Projekt hat kein Panorama. Panoramen in den Ordner panoramas legen oder mit Datei, Panoramen von Diensten welche laden.</translation>
    </message>
    <message>
        <source>view %1</source>
        <translation>Ansicht %1</translation>
    </message>
    <message>
        <source>Run whose images are listed</source>
        <translation>Fahrt, deren Bilder aufgeführt sind</translation>
    </message>
    <message>
        <source>Panorama or photo that stands beside the image</source>
        <translation>Panorama oder Foto neben dem Bild</translation>
    </message>
    <message>
        <source>Outlines of the tags found in the image; gray: excluded by the review</source>
        <translation>Umrisse der im Bild gefundenen Marken; grau: bei der Durchsicht ausgeschlossen</translation>
    </message>
    <message>
        <source>Points of the solution where the image shows them, with their reprojection errors (px) drawn ten times as long</source>
        <translation>Punkte der Lösung, wo das Bild sie zeigt, mit ihren Rückprojektionsfehlern (px), zehnfach verlängert</translation>
    </message>
    <message>
        <source>Matches with the panorama within 3 px of their epipolar lines</source>
        <translation>Zuordnungen zum Panorama, höchstens 3 px von ihren Epipolarlinien</translation>
    </message>
    <message>
        <source>Matches with the panorama farther than 3 px from their epipolar lines</source>
        <translation>Zuordnungen zum Panorama, mehr als 3 px von ihren Epipolarlinien</translation>
    </message>
    <message>
        <source>mark %1 in %2</source>
        <translation>%1 in %2 markieren</translation>
    </message>
    <message>
        <source>remove the mark of %1 in %2</source>
        <translation>die Markierung von %1 in %2 entfernen</translation>
    </message>
    <message>
        <source>move the mark of %1 in %2</source>
        <translation>die Markierung von %1 in %2 verschieben</translation>
    </message>
    <message>
        <source>The change of the mark was not saved.</source>
        <translation>Die Änderung der Markierung wurde nicht gespeichert.</translation>
    </message>
    <message>
        <source>All of the panorama, or one of the rectilinear views that localize matches; of a set one of its photos</source>
        <translation>Das ganze Panorama oder eine der geradlinigen Ansichten, die localize zuordnet; von einem Satz eines seiner Fotos</translation>
    </message>
    <message>
        <source>%1 matches; the run does not answer %2, so that they cannot be judged</source>
        <translation>%1 Zuordnungen; die Fahrt beantwortet %2 nicht, so dass sie nicht beurteilt werden können</translation>
    </message>
</context>
<context>
    <name>trigpoint::MainWindow</name>
    <message>
        <source>Trigpoint</source>
        <translation>Trigpoint</translation>
    </message>
    <message>
        <source>Desks</source>
        <translation>Ansichten</translation>
    </message>
    <message>
        <source>Overview</source>
        <translation>Übersicht</translation>
    </message>
    <message>
        <source>Run</source>
        <translation>Ausführen</translation>
    </message>
    <message>
        <source>3D</source>
        <translation>3D</translation>
    </message>
    <message>
        <source>Images</source>
        <translation>Bilder</translation>
    </message>
    <message>
        <source>Tables</source>
        <translation>Tabellen</translation>
    </message>
    <message>
        <source>Compare</source>
        <translation>Vergleichen</translation>
    </message>
    <message>
        <source>Review</source>
        <translation>Prüfen</translation>
    </message>
    <message>
        <source>Panoramas</source>
        <translation>Panoramen</translation>
    </message>
    <message>
        <source>Calibration</source>
        <translation>Kalibrierung</translation>
    </message>
    <message>
        <source>Site</source>
        <translation>Messgebiet</translation>
    </message>
    <message>
        <source>Cancel</source>
        <translation>Abbrechen</translation>
    </message>
    <message>
        <source>%1 - Trigpoint</source>
        <translation>%1 - Trigpoint</translation>
    </message>
    <message>
        <source>%1: %2, %3 %</source>
        <translation>%1: %2, %3 %</translation>
    </message>
    <message>
        <source>Done.</source>
        <translation>Fertig.</translation>
    </message>
    <message>
        <source>Failed.</source>
        <translation>Fehlgeschlagen.</translation>
    </message>
    <message>
        <source>Cancelled; finished stages are kept.</source>
        <translation>Abgebrochen; fertige Stufen bleiben erhalten.</translation>
    </message>
    <message>
        <source>Open a project&apos;s folder</source>
        <translation>Den Ordner eines Projekts öffnen</translation>
    </message>
    <message>
        <source>There is no report yet: run the stage report.</source>
        <translation>Es gibt noch keinen Bericht: die Stufe report ausführen.</translation>
    </message>
    <message>
        <source>No program opens the report: %1</source>
        <translation>Kein Programm öffnet den Bericht: %1</translation>
    </message>
    <message>
        <source>&amp;File</source>
        <translation>&amp;Datei</translation>
    </message>
    <message>
        <source>&amp;Open project or folder ...</source>
        <translation>Projekt oder Ordner &amp;öffnen ...</translation>
    </message>
    <message>
        <source>&amp;Recent projects</source>
        <translation>&amp;Letzte Projekte</translation>
    </message>
    <message>
        <source>Re&amp;load</source>
        <translation>Neu &amp;laden</translation>
    </message>
    <message>
        <source>&amp;Close project</source>
        <translation>Projekt s&amp;chließen</translation>
    </message>
    <message>
        <source>Open the &amp;report</source>
        <translation>&amp;Bericht öffnen</translation>
    </message>
    <message>
        <source>Ctrl+Shift+O</source>
        <translation>Ctrl+Shift+O</translation>
    </message>
    <message>
        <source>&amp;Quit</source>
        <translation>&amp;Beenden</translation>
    </message>
    <message>
        <source>&amp;Run</source>
        <translation>&amp;Ausführen</translation>
    </message>
    <message>
        <source>Run all that is &amp;out of date</source>
        <translation>Alles &amp;Veraltete ausführen</translation>
    </message>
    <message>
        <source>Ctrl+R</source>
        <translation>Ctrl+R</translation>
    </message>
    <message>
        <source>&amp;Cancel</source>
        <translation>&amp;Abbrechen</translation>
    </message>
    <message>
        <source>Ctrl+.</source>
        <translation>Ctrl+.</translation>
    </message>
    <message>
        <source>Re-&amp;solve after a review</source>
        <translation>Nach einer Prüfung neu &amp;lösen</translation>
    </message>
    <message>
        <source>Ctrl+Shift+R</source>
        <translation>Ctrl+Shift+R</translation>
    </message>
    <message>
        <source>&amp;View</source>
        <translation>A&amp;nsicht</translation>
    </message>
    <message>
        <source>Ctrl+%1</source>
        <translation>Ctrl+%1</translation>
    </message>
    <message>
        <source>&amp;Units</source>
        <translation>&amp;Einheiten</translation>
    </message>
    <message>
        <source>metres</source>
        <translation>Meter</translation>
    </message>
    <message>
        <source>feet</source>
        <translation>Fuß</translation>
    </message>
    <message>
        <source>US survey feet</source>
        <translation>US-Survey-Fuß</translation>
    </message>
    <message>
        <source>&amp;Theme</source>
        <translation>&amp;Farben</translation>
    </message>
    <message>
        <source>as the system</source>
        <translation>wie das System</translation>
    </message>
    <message>
        <source>light</source>
        <translation>hell</translation>
    </message>
    <message>
        <source>dark</source>
        <translation>dunkel</translation>
    </message>
    <message>
        <source>Opening %1 ...</source>
        <translation>%1 wird geöffnet ...</translation>
    </message>
    <message>
        <source>No project was made.</source>
        <translation>Es wurde kein Projekt angelegt.</translation>
    </message>
    <message>
        <source>Drop a project folder here, or open one (Ctrl+O).</source>
        <translation>Einen Projektordner hierher ziehen oder öffnen (Strg+O).</translation>
    </message>
    <message>
        <source>Stopping the run ...</source>
        <translation>Die Berechnung wird angehalten ...</translation>
    </message>
    <message>
        <source>Charts</source>
        <translation>Diagramme</translation>
    </message>
    <message>
        <source>Station</source>
        <translation>Station</translation>
    </message>
    <message>
        <source>Where the folder trigpoint-demo is made</source>
        <translation>Wo der Ordner trigpoint-demo angelegt wird</translation>
    </message>
    <message>
        <source>&amp;Export ...</source>
        <translation>&amp;Exportieren ...</translation>
    </message>
    <message>
        <source>Ctrl+E</source>
        <translation>Ctrl+E</translation>
    </message>
    <message>
        <source>&amp;Help</source>
        <translation>&amp;Hilfe</translation>
    </message>
    <message>
        <source>&amp;Keys and terms</source>
        <translation>&amp;Tasten und Begriffe</translation>
    </message>
    <message>
        <source>&amp;About</source>
        <translation>&amp;Über</translation>
    </message>
    <message>
        <source>Trigpoint %1: ground truth for visual localization.</source>
        <translation>Trigpoint %1: Referenzdaten für visuelle Lokalisierung.</translation>
    </message>
    <message>
        <source>Make the r&amp;eport ...</source>
        <translation>B&amp;ericht erstellen ...</translation>
    </message>
    <message>
        <source>Cross-check with COL&amp;MAP ...</source>
        <translation>Mit COL&amp;MAP gegenprüfen ...</translation>
    </message>
    <message>
        <source>&amp;Plan a survey ...</source>
        <translation>Vermessung &amp;planen ...</translation>
    </message>
    <message>
        <source>Print &amp;tags and boards ...</source>
        <translation>&amp;Marken und Tafeln drucken ...</translation>
    </message>
    <message>
        <source>Open a project first.</source>
        <translation>Zuerst ein Projekt öffnen.</translation>
    </message>
    <message>
        <source>&amp;Edit</source>
        <translation>&amp;Bearbeiten</translation>
    </message>
    <message>
        <source>&amp;Undo</source>
        <translation>&amp;Rückgängig</translation>
    </message>
    <message>
        <source>&amp;Redo</source>
        <translation>&amp;Wiederholen</translation>
    </message>
    <message>
        <source>&amp;Undo: %1</source>
        <translation>&amp;Rückgängig: %1</translation>
    </message>
    <message>
        <source>&amp;Redo: %1</source>
        <translation>&amp;Wiederholen: %1</translation>
    </message>
    <message>
        <source>Show its &amp;image</source>
        <translation>&amp;Bild zeigen</translation>
    </message>
    <message>
        <source>Show in &amp;3D</source>
        <translation>In &amp;3D zeigen</translation>
    </message>
    <message>
        <source>Copying the example ...</source>
        <translation>Das Beispiel wird kopiert ...</translation>
    </message>
    <message>
        <source>The example was not made.</source>
        <translation>Das Beispiel wurde nicht angelegt.</translation>
    </message>
    <message>
        <source>&amp;Panoramas of services ...</source>
        <translation>&amp;Panoramen von Diensten ...</translation>
    </message>
    <message>
        <source>Pu&amp;blish ...</source>
        <translation>&amp;Veröffentlichen ...</translation>
    </message>
    <message>
        <source>Check</source>
        <translation>Prüfung</translation>
    </message>
    <message>
        <source>Chec&amp;k what was recorded so far</source>
        <translation>Bisherige Aufnahmen &amp;prüfen</translation>
    </message>
    <message>
        <source>Ctrl+Alt+%1</source>
        <translation>Ctrl+Alt+%1</translation>
    </message>
    <message>
        <source>Plan</source>
        <translation>Plan</translation>
    </message>
    <message>
        <source>&amp;Import ...</source>
        <translation>&amp;Importieren ...</translation>
    </message>
    <message>
        <source>Ctrl+I</source>
        <translation>Ctrl+I</translation>
    </message>
    <message>
        <source>Print</source>
        <translation>Drucken</translation>
    </message>
    <message>
        <source>The sketch of the plan is not saved.</source>
        <translation>Die Skizze der Planung ist nicht gespeichert.</translation>
    </message>
    <message>
        <source>Ctrl+Shift+Z</source>
        <translation>Ctrl+Shift+Z</translation>
    </message>
    <message>
        <source>Ctrl+Y</source>
        <translation>Ctrl+Y</translation>
    </message>
</context>
<context>
    <name>trigpoint::MeasurementList</name>
    <message>
        <source>Measurements</source>
        <translation>Messungen</translation>
    </message>
    <message>
        <source>&amp;Save as CSV ...</source>
        <translation>Als CSV &amp;speichern ...</translation>
    </message>
    <message>
        <source>&amp;Clear</source>
        <translation>&amp;Leeren</translation>
    </message>
    <message>
        <source>from</source>
        <translation>von</translation>
    </message>
    <message>
        <source>to</source>
        <translation>nach</translation>
    </message>
    <message>
        <source>slope (%1)</source>
        <translation>Schrägstrecke (%1)</translation>
    </message>
    <message>
        <source>horizontal (%1)</source>
        <translation>Horizontalstrecke (%1)</translation>
    </message>
    <message>
        <source>height difference (%1)</source>
        <translation>Höhenunterschied (%1)</translation>
    </message>
    <message>
        <source>azimuth (deg)</source>
        <translation>Richtungswinkel (Grad)</translation>
    </message>
    <message>
        <source>sigmas</source>
        <translation>Sigmas</translation>
    </message>
    <message>
        <source>being computed ...</source>
        <translation>wird berechnet ...</translation>
    </message>
    <message>
        <source>joint</source>
        <translation>gemeinsam</translation>
    </message>
    <message>
        <source>independent</source>
        <translation>unabhängig</translation>
    </message>
    <message>
        <source>1 sigma behind each value: from the joint covariance of two cameras or panoramas of one run, or of two tags; other places are taken as independent (last column); points, paths and geotags have no sigma of their own. Right click: save, clear.</source>
        <translation>1 Sigma hinter jedem Wert: aus der gemeinsamen Kovarianz zweier Kameras oder Panoramen einer Fahrt oder zweier Marken; andere Orte gelten als unabhängig (letzte Spalte); Punkte, Wege und Geotags haben kein eigenes Sigma. Rechtsklick: speichern, leeren.</translation>
    </message>
    <message>
        <source>not known</source>
        <translation>unbekannt</translation>
    </message>
</context>
<context>
    <name>trigpoint::OverviewDesk</name>
    <message>
        <source>Verdict</source>
        <translation>Befund</translation>
    </message>
    <message>
        <source>Plan</source>
        <translation>Lageplan</translation>
    </message>
    <message>
        <source>Reading ...</source>
        <translation>Wird gelesen ...</translation>
    </message>
    <message>
        <source>The overview is not shown.</source>
        <translation>Die Übersicht wird nicht gezeigt.</translation>
    </message>
    <message>
        <source>Trigpoint</source>
        <translation>Trigpoint</translation>
    </message>
    <message>
        <source>Localizes panoramas and photos against a camera&apos;s run, surveys tags, and measures how good the answers are.</source>
        <translation>Bestimmt die Lage von Panoramen und Fotos aus der Fahrt einer Kamera, vermisst Marken und prüft, wie genau die Ergebnisse sind.</translation>
    </message>
    <message>
        <source>&amp;Open a project ...</source>
        <translation>Projekt öf&amp;fnen ...</translation>
    </message>
    <message>
        <source>A folder can also be dropped into the window. It is only read; nothing is written without asking.</source>
        <translation>Ein Ordner lässt sich auch ins Fenster ziehen. Er wird nur gelesen; geschrieben wird erst auf Nachfrage.</translation>
    </message>
    <message>
        <source>Recent projects</source>
        <translation>Letzte Projekte</translation>
    </message>
    <message>
        <source>This folder has no trigpoint.yaml. Nothing is written into it until you ask for it.</source>
        <translation>Dieser Ordner hat keine trigpoint.yaml. Es wird nichts hineingeschrieben, bevor es verlangt wird.</translation>
    </message>
    <message>
        <source>Found</source>
        <translation>Gefunden</translation>
    </message>
    <message>
        <source>Missing</source>
        <translation>Es fehlt</translation>
    </message>
    <message>
        <source>&lt;b&gt;3D error (%1)&lt;/b&gt;, %2. Below it 1 sigma of the difference, and NEES per degree of freedom (about 1 if the sigmas are right).</source>
        <translation>&lt;b&gt;3D-Fehler (%1)&lt;/b&gt;, %2. Darunter 1 Sigma der Differenz und NEES je Freiheitsgrad (etwa 1, wenn die Sigmas stimmen).</translation>
    </message>
    <message>
        <source>Errors by station and run</source>
        <translation>Fehler nach Station und Fahrt</translation>
    </message>
    <message>
        <source>Warnings (%1)</source>
        <translation>Warnungen (%1)</translation>
    </message>
    <message>
        <source>plan</source>
        <translation>Lageplan</translation>
    </message>
    <message>
        <source>Not a project yet.</source>
        <translation>Noch kein Projekt.</translation>
    </message>
    <message>
        <source>&amp;Make it a project (write trigpoint.yaml)</source>
        <translation>Zum Projekt &amp;machen (trigpoint.yaml schreiben)</translation>
    </message>
    <message>
        <source>Failed results: %1. %2</source>
        <translation>%1 Ergebnisse sind fehlgeschlagen. %2</translation>
    </message>
    <message>
        <source>&amp;Run again what failed</source>
        <translation>Fehlgeschlagenes &amp;noch einmal ausführen</translation>
    </message>
    <message>
        <source>&amp;Run what is out of date</source>
        <translation>&amp;Veraltetes ausführen</translation>
    </message>
    <message>
        <source>Every result is up to date.</source>
        <translation>Alle Ergebnisse sind aktuell.</translation>
    </message>
    <message>
        <source>Open the &amp;report</source>
        <translation>&amp;Bericht öffnen</translation>
    </message>
    <message>
        <source>Make the &amp;example ...</source>
        <translation>&amp;Beispiel anlegen ...</translation>
    </message>
    <message>
        <source>Copies a small site with two runs into a new folder and opens it</source>
        <translation>Kopiert ein kleines Messgebiet mit zwei Fahrten in einen neuen Ordner und öffnet es</translation>
    </message>
    <message>
        <source>None yet. Begin with the example.</source>
        <translation>Noch keine. Mit dem Beispiel beginnen.</translation>
    </message>
    <message>
        <source>Show the other %1</source>
        <translation>Die anderen %1 zeigen</translation>
    </message>
    <message>
        <source>&lt;b&gt;Answers&lt;/b&gt;, without a reference to compare them with. Below each the 1 sigma that it states, of its largest axis (%1), or why there is none.</source>
        <translation>&lt;b&gt;Antworten&lt;/b&gt;, ohne Referenz zum Vergleich. Darunter je das angegebene 1 Sigma der größten Achse (%1), oder warum es keines gibt.</translation>
    </message>
    <message>
        <source>Answers by panorama and run</source>
        <translation>Antworten nach Panorama und Fahrt</translation>
    </message>
    <message>
        <source>Checking what is up to date ...</source>
        <translation>Es wird geprüft, was aktuell ist ...</translation>
    </message>
    <message>
        <source>Running: %1</source>
        <translation>Läuft: %1</translation>
    </message>
    <message>
        <source>%1 (excluded)</source>
        <translation>%1 (ausgeschlossen)</translation>
    </message>
    <message>
        <source>Nothing to draw yet.</source>
        <translation>Noch nichts zu zeichnen.</translation>
    </message>
    <message>
        <source>One result is missing or out of date: %1.</source>
        <translation>Ein Ergebnis fehlt oder ist veraltet: %1.</translation>
    </message>
    <message>
        <source>%1 results are missing or out of date; %2 is first.</source>
        <translation>%1 Ergebnisse fehlen oder sind veraltet; zuerst kommt %2.</translation>
    </message>
</context>
<context>
    <name>trigpoint::PanoramaDesk</name>
    <message>
        <source>Panorama or photo set</source>
        <translation>Panorama oder Fotosatz</translation>
    </message>
    <message>
        <source>&amp;Stitch ...</source>
        <translation>&amp;Zusammensetzen ...</translation>
    </message>
    <message>
        <source>Photos of the set and their refined centres</source>
        <translation>Fotos des Satzes und ihre verbesserten Zentren</translation>
    </message>
    <message>
        <source>Panorama</source>
        <translation>Panorama</translation>
    </message>
    <message>
        <source>Which photos match, by where they look</source>
        <translation>Welche Fotos sich zuordnen lassen, nach Blickrichtung</translation>
    </message>
    <message>
        <source>Photo</source>
        <translation>Foto</translation>
    </message>
    <message>
        <source>reading %1 ...</source>
        <translation>%1 wird gelesen ...</translation>
    </message>
    <message>
        <source>%1 photos</source>
        <translation>%1 Fotos</translation>
    </message>
    <message>
        <source>closure error %1 deg</source>
        <translation>Schlussfehler %1 Grad</translation>
    </message>
    <message>
        <source>%1 % of the sphere covered</source>
        <translation>%1 % der Kugel abgedeckt</translation>
    </message>
    <message>
        <source>median parallax %1 px</source>
        <translation>mittlere Parallaxe (Median) %1 px</translation>
    </message>
    <message>
        <source>pairs, by direction</source>
        <translation>Paare, nach Richtung</translation>
    </message>
    <message>
        <source>photo</source>
        <translation>Foto</translation>
    </message>
    <message>
        <source>right (%1)</source>
        <translation>rechts (%1)</translation>
    </message>
    <message>
        <source>down (%1)</source>
        <translation>unten (%1)</translation>
    </message>
    <message>
        <source>forward (%1)</source>
        <translation>vorn (%1)</translation>
    </message>
    <message>
        <source>1 sigma (%1)</source>
        <translation>1 Sigma (%1)</translation>
    </message>
    <message>
        <source>focal length (px)</source>
        <translation>Brennweite (px)</translation>
    </message>
    <message>
        <source>not placed</source>
        <translation>nicht eingepasst</translation>
    </message>
    <message>
        <source>Select a photo in the table.</source>
        <translation>Ein Foto in der Tabelle auswählen.</translation>
    </message>
    <message>
        <source>No panorama yet: put pictures into panoramas/ or photos/, and read the project again.</source>
        <translation>Noch kein Panorama: Bilder in panoramas/ oder photos/ legen und das Projekt neu lesen.</translation>
    </message>
    <message>
        <source>Not stitched yet: press Stitch.</source>
        <translation>Noch nicht zusammengesetzt: Zusammensetzen drücken.</translation>
    </message>
    <message>
        <source>This is no photo set.</source>
        <translation>Das ist kein Fotosatz.</translation>
    </message>
    <message>
        <source>file of the photo</source>
        <translation>Datei des Fotos</translation>
    </message>
    <message>
        <source>centre of the photo to the right of the panorama&apos;s centre (%1)</source>
        <translation>Zentrum des Fotos rechts vom Zentrum des Panoramas (%1)</translation>
    </message>
    <message>
        <source>centre of the photo below the panorama&apos;s centre (%1)</source>
        <translation>Zentrum des Fotos unter dem Zentrum des Panoramas (%1)</translation>
    </message>
    <message>
        <source>centre of the photo in front of the panorama&apos;s centre (%1)</source>
        <translation>Zentrum des Fotos vor dem Zentrum des Panoramas (%1)</translation>
    </message>
    <message>
        <source>1 sigma of the photo&apos;s centre relative to the panorama&apos;s, the largest axis (%1)</source>
        <translation>1 Sigma des Zentrums des Fotos gegen das des Panoramas, größte Achse (%1)</translation>
    </message>
    <message>
        <source>focal length as estimated (px)</source>
        <translation>geschätzte Brennweite (px)</translation>
    </message>
    <message>
        <source>Panorama or photo set that is shown</source>
        <translation>Angezeigtes Panorama oder angezeigter Fotosatz</translation>
    </message>
    <message>
        <source>Which photos of a set match is drawn here.</source>
        <translation>Hier wird gezeichnet, welche Fotos eines Satzes zusammenpassen.</translation>
    </message>
    <message>
        <source>Open a project (Ctrl+O) to see its panoramas and photo sets.</source>
        <translation>Ein Projekt öffnen (Strg+O), um seine Panoramen und Fotosätze zu sehen.</translation>
    </message>
</context>
<context>
    <name>trigpoint::PathButton</name>
    <message>
        <source>Choose a folder</source>
        <translation>Einen Ordner wählen</translation>
    </message>
    <message>
        <source>Choose a file</source>
        <translation>Eine Datei wählen</translation>
    </message>
    <message>
        <source>...</source>
        <translation>...</translation>
    </message>
    <message>
        <source>Choose: %1</source>
        <translation>Wählen: %1</translation>
    </message>
    <message>
        <source>Choose a file or a folder</source>
        <translation>Eine Datei oder einen Ordner wählen</translation>
    </message>
    <message>
        <source>F&amp;ile ...</source>
        <translation>&amp;Datei ...</translation>
    </message>
    <message>
        <source>F&amp;older ...</source>
        <translation>&amp;Ordner ...</translation>
    </message>
</context>
<context>
    <name>trigpoint::PictureView</name>
    <message>
        <source>Wheel or + and -: zoom; drag or arrows: move; 0: fit; 1: pixel by pixel</source>
        <translation>Mausrad oder + und -: Zoom; Ziehen oder Pfeile: Verschieben; 0: ganz; 1: Pixel für Pixel</translation>
    </message>
    <message>
        <source>no picture</source>
        <translation>kein Bild</translation>
    </message>
</context>
<context>
    <name>trigpoint::PlanDesk</name>
    <message>
        <source>Select, move</source>
        <translation>Wählen, bewegen</translation>
    </message>
    <message>
        <source>Click on an item to select it, drag it to move it</source>
        <translation>Ein Klick wählt ein Objekt, Ziehen bewegt es</translation>
    </message>
    <message>
        <source>Tag</source>
        <translation>Marke</translation>
    </message>
    <message>
        <source>Click where it is, then where its printed side faces</source>
        <translation>Klicken, wo es steht, dann, wohin seine bedruckte Seite zeigt</translation>
    </message>
    <message>
        <source>Place for a tag</source>
        <translation>Platz für eine Marke</translation>
    </message>
    <message>
        <source>A place where one more tag could be: Suggest chooses among them</source>
        <translation>Ein Platz für eine weitere Marke: Vorschläge werden unter diesen gewählt</translation>
    </message>
    <message>
        <source>Control</source>
        <translation>Passpunkt</translation>
    </message>
    <message>
        <source>Click on a tag that is surveyed and used as control</source>
        <translation>Auf eine Marke klicken, die eingemessen ist und als Passpunkt dient</translation>
    </message>
    <message>
        <source>Check point</source>
        <translation>Kontrollpunkt</translation>
    </message>
    <message>
        <source>Click on a tag that is surveyed and kept apart as check point</source>
        <translation>Auf eine Marke klicken, die eingemessen ist und als Kontrollpunkt zurückgehalten wird</translation>
    </message>
    <message>
        <source>Station</source>
        <translation>Station</translation>
    </message>
    <message>
        <source>Click where a panorama is taken</source>
        <translation>Klicken, wo ein Panorama aufgenommen wird</translation>
    </message>
    <message>
        <source>Path</source>
        <translation>Weg</translation>
    </message>
    <message>
        <source>Click the corners of a way along which the camera is carried; a double click ends it</source>
        <translation>Die Ecken des Weges anklicken, auf dem die Kamera getragen wird; ein Doppelklick beendet ihn</translation>
    </message>
    <message>
        <source>&amp;Delete</source>
        <translation>&amp;Löschen</translation>
    </message>
    <message>
        <source>The selected item; a tag with its control and check points</source>
        <translation>Das gewählte Objekt; eine Marke samt ihren Pass- und Kontrollpunkten</translation>
    </message>
    <message>
        <source>Undo</source>
        <translation>Rückgängig</translation>
    </message>
    <message>
        <source>The last change of the sketch</source>
        <translation>Die letzte Änderung der Skizze</translation>
    </message>
    <message>
        <source>Sa&amp;ve</source>
        <translation>&amp;Speichern</translation>
    </message>
    <message>
        <source>Writes plan.csv; the file as it was is kept in results/replaced</source>
        <translation>Schreibt plan.csv; die bisherige Datei bleibt in results/replaced</translation>
    </message>
    <message>
        <source>&amp;Predict</source>
        <translation>&amp;Vorhersagen</translation>
    </message>
    <message>
        <source>Saves the sketch and runs trigpoint plan</source>
        <translation>Speichert die Skizze und führt trigpoint plan aus</translation>
    </message>
    <message>
        <source>&amp;Options ...</source>
        <translation>&amp;Optionen ...</translation>
    </message>
    <message>
        <source>Camera, speed, noise, gates of the stage plan</source>
        <translation>Kamera, Geschwindigkeit, Rauschen, Grenzwerte der Stufe plan</translation>
    </message>
    <message>
        <source>Open the &amp;page</source>
        <translation>&amp;Seite öffnen</translation>
    </message>
    <message>
        <source>results/plan/index.html in the browser</source>
        <translation>results/plan/index.html im Browser</translation>
    </message>
    <message>
        <source>Add what is proposed</source>
        <translation>Vorschlag übernehmen</translation>
    </message>
    <message>
        <source>Puts the selected place into the sketch as a tag</source>
        <translation>Nimmt den gewählten Platz als Marke in die Skizze auf</translation>
    </message>
    <message>
        <source>What to propose</source>
        <translation>Was vorgeschlagen wird</translation>
    </message>
    <message>
        <source>propose nothing</source>
        <translation>nichts vorschlagen</translation>
    </message>
    <message>
        <source>propose tags</source>
        <translation>Marken vorschlagen</translation>
    </message>
    <message>
        <source>propose control</source>
        <translation>Passpunkte vorschlagen</translation>
    </message>
    <message>
        <source>propose passes</source>
        <translation>Durchgänge vorschlagen</translation>
    </message>
    <message>
        <source>How many to propose</source>
        <translation>Anzahl der Vorschläge</translation>
    </message>
    <message>
        <source>up</source>
        <translation>Höhe</translation>
    </message>
    <message>
        <source>Height of what is added next, site ENU</source>
        <translation>Höhe des nächsten Objekts, lokales ENU</translation>
    </message>
    <message>
        <source>size</source>
        <translation>Größe</translation>
    </message>
    <message>
        <source>mm</source>
        <translation>mm</translation>
    </message>
    <message>
        <source>Black square of a tag that is added next and is not in tags.yaml</source>
        <translation>Schwarzes Quadrat der nächsten Marke, wenn sie nicht in tags.yaml steht</translation>
    </message>
    <message>
        <source>Items of the sketch</source>
        <translation>Objekte der Skizze</translation>
    </message>
    <message>
        <source>Predicted sigmas of the tags</source>
        <translation>Vorhergesagte Sigmas der Marken</translation>
    </message>
    <message>
        <source>Gain of one more</source>
        <translation>Gewinn durch eins mehr</translation>
    </message>
    <message>
        <source>Plan</source>
        <translation>Plan</translation>
    </message>
    <message>
        <source>No program opens the page: %1</source>
        <translation>Kein Programm öffnet die Seite: %1</translation>
    </message>
    <message>
        <source>Click where the next one is.</source>
        <translation>Klicken, wo das nächste steht.</translation>
    </message>
    <message>
        <source>Click where its printed side faces.</source>
        <translation>Klicken, wohin seine bedruckte Seite zeigt.</translation>
    </message>
    <message>
        <source>Click on a tag: control and check points are tags that are surveyed.</source>
        <translation>Auf eine Marke klicken: Pass- und Kontrollpunkte sind eingemessene Marken.</translation>
    </message>
    <message>
        <source>&apos;%1&apos; does not fit: expected %2.</source>
        <translation>&apos;%1&apos; passt nicht: erwartet wird %2.</translation>
    </message>
    <message>
        <source>a name, or a tag&apos;s id</source>
        <translation>ein Name oder die Nummer einer Marke</translation>
    </message>
    <message>
        <source>a number, sizes and sigmas above 0</source>
        <translation>eine Zahl, Größen und Sigmas über 0</translation>
    </message>
    <message>
        <source>Saved as plan.csv.</source>
        <translation>Als plan.csv gespeichert.</translation>
    </message>
    <message>
        <source>Saved as plan.csv; as it was before: %1</source>
        <translation>Als plan.csv gespeichert; die bisherige Datei: %1</translation>
    </message>
    <message>
        <source>The sketch was not saved.</source>
        <translation>Die Skizze wurde nicht gespeichert.</translation>
    </message>
    <message>
        <source>Predicting ...</source>
        <translation>Vorhersage läuft ...</translation>
    </message>
    <message>
        <source>kind</source>
        <translation>Art</translation>
    </message>
    <message>
        <source>name</source>
        <translation>Name</translation>
    </message>
    <message>
        <source>east (%1)</source>
        <translation>Ost (%1)</translation>
    </message>
    <message>
        <source>north (%1)</source>
        <translation>Nord (%1)</translation>
    </message>
    <message>
        <source>up (%1)</source>
        <translation>Höhe (%1)</translation>
    </message>
    <message>
        <source>faces (deg)</source>
        <translation>Richtung (Grad)</translation>
    </message>
    <message>
        <source>size (mm)</source>
        <translation>Größe (mm)</translation>
    </message>
    <message>
        <source>sigma h (%1)</source>
        <translation>Sigma L (%1)</translation>
    </message>
    <message>
        <source>sigma v (%1)</source>
        <translation>Sigma H (%1)</translation>
    </message>
    <message>
        <source>tag</source>
        <translation>Marke</translation>
    </message>
    <message>
        <source>Open a project, then draw its tags and paths here.</source>
        <translation>Ein Projekt öffnen, dann seine Marken und Wege hier zeichnen.</translation>
    </message>
    <message>
        <source>; ellipses: predicted, 95 %, at true scale</source>
        <translation>; Ellipsen: vorhergesagt, 95 %, im Maßstab des Plans</translation>
    </message>
    <message>
        <source>; ellipses: predicted, 95 %, %1 times enlarged</source>
        <translation>; Ellipsen: vorhergesagt, 95 %, %1-fach vergrößert</translation>
    </message>
    <message>
        <source>; changed since the last prediction</source>
        <translation>; seit der letzten Vorhersage geändert</translation>
    </message>
    <message>
        <source>role</source>
        <translation>Rolle</translation>
    </message>
    <message>
        <source>pictures</source>
        <translation>Bilder</translation>
    </message>
    <message>
        <source>passes</source>
        <translation>Durchgänge</translation>
    </message>
    <message>
        <source>horizontal (mm)</source>
        <translation>Lage (mm)</translation>
    </message>
    <message>
        <source>up (mm)</source>
        <translation>Höhe (mm)</translation>
    </message>
    <message>
        <source>3D (mm)</source>
        <translation>3D (mm)</translation>
    </message>
    <message>
        <source>not seen</source>
        <translation>nicht gesehen</translation>
    </message>
    <message>
        <source>rank</source>
        <translation>Rang</translation>
    </message>
    <message>
        <source>proposed, one after the other</source>
        <translation>vorgeschlagen, nacheinander</translation>
    </message>
    <message>
        <source>one more of</source>
        <translation>eins mehr</translation>
    </message>
    <message>
        <source>RMS of the tags (mm)</source>
        <translation>RMS der Marken (mm)</translation>
    </message>
    <message>
        <source>gain (%)</source>
        <translation>Gewinn (%)</translation>
    </message>
    <message>
        <source>what the item is; a path has a row for each corner</source>
        <translation>was der Eintrag ist; ein Weg hat eine Zeile für jede Ecke</translation>
    </message>
    <message>
        <source>its name, of a tag its id</source>
        <translation>sein Name, bei einer Marke ihre Nummer</translation>
    </message>
    <message>
        <source>site ENU, %1</source>
        <translation>ENU des Geländes, %1</translation>
    </message>
    <message>
        <source>azimuth that its printed side faces, degrees from north over east</source>
        <translation>Azimut, in das die bedruckte Seite zeigt, Grad von Nord über Ost</translation>
    </message>
    <message>
        <source>edge of a tag&apos;s black square, mm; empty: as in tags.yaml</source>
        <translation>Kante des schwarzen Quadrats einer Marke, mm; leer: wie in tags.yaml</translation>
    </message>
    <message>
        <source>1 sigma per horizontal axis of a surveyed position, %1</source>
        <translation>1 Sigma je waagrechter Achse einer vermessenen Position, %1</translation>
    </message>
    <message>
        <source>1 sigma of a surveyed height, %1</source>
        <translation>1 Sigma einer vermessenen Höhe, %1</translation>
    </message>
    <message>
        <source>the tag that a station belongs to</source>
        <translation>die Marke, zu der eine Station gehört</translation>
    </message>
    <message>
        <source>id</source>
        <translation>Nummer</translation>
    </message>
    <message>
        <source>what the tag is in the plan</source>
        <translation>was die Marke in der Planung ist</translation>
    </message>
    <message>
        <source>number of pictures that see it</source>
        <translation>Zahl der Bilder, die sie sehen</translation>
    </message>
    <message>
        <source>number of passes that see it</source>
        <translation>Zahl der Vorbeifahrten, die sie sehen</translation>
    </message>
    <message>
        <source>predicted 1 sigma of both horizontal axes together, mm</source>
        <translation>vorhergesagtes 1 Sigma beider waagrechten Achsen zusammen, mm</translation>
    </message>
    <message>
        <source>predicted 1 sigma of the height, mm</source>
        <translation>vorhergesagtes 1 Sigma der Höhe, mm</translation>
    </message>
    <message>
        <source>predicted 1 sigma in space, mm</source>
        <translation>vorhergesagtes räumliches 1 Sigma, mm</translation>
    </message>
    <message>
        <source>the largest gain comes first</source>
        <translation>der größte Gewinn steht zuerst</translation>
    </message>
    <message>
        <source>what is added to the plan</source>
        <translation>was zur Planung hinzukommt</translation>
    </message>
    <message>
        <source>RMS of the tags&apos; predicted 3D sigmas with it, mm</source>
        <translation>RMS der vorhergesagten räumlichen Sigmas der Marken damit, mm</translation>
    </message>
    <message>
        <source>by how much it makes that RMS smaller, per cent</source>
        <translation>um wie viel es diesen RMS verkleinert, Prozent</translation>
    </message>
    <message>
        <source>draw %1</source>
        <translation>%1 zeichnen</translation>
    </message>
    <message>
        <source>change %1</source>
        <translation>%1 ändern</translation>
    </message>
    <message>
        <source>move %1</source>
        <translation>%1 verschieben</translation>
    </message>
    <message>
        <source>delete %1</source>
        <translation>%1 löschen</translation>
    </message>
    <message>
        <source>Redo</source>
        <translation>Wiederholen</translation>
    </message>
    <message>
        <source>The change of the sketch that was taken back last</source>
        <translation>Die zuletzt zurückgenommene Änderung der Skizze</translation>
    </message>
    <message>
        <source>site ENU, %1, north up</source>
        <translation>ENU des Messgebiets, %1, Norden oben</translation>
    </message>
</context>
<context>
    <name>trigpoint::PrintDesk</name>
    <message>
        <source> mm</source>
        <translation> mm</translation>
    </message>
    <message>
        <source>What is printed</source>
        <translation>Was gedruckt wird</translation>
    </message>
    <message>
        <source>tags</source>
        <translation>Marken</translation>
    </message>
    <message>
        <source>calibration board</source>
        <translation>Kalibriertafel</translation>
    </message>
    <message>
        <source>scale bar</source>
        <translation>Maßstab</translation>
    </message>
    <message>
        <source>Tag family</source>
        <translation>Markenfamilie</translation>
    </message>
    <message>
        <source>as in tags.yaml, else tag36h11</source>
        <translation>wie in tags.yaml, sonst tag36h11</translation>
    </message>
    <message>
        <source>Ids of the tags</source>
        <translation>Nummern der Marken</translation>
    </message>
    <message>
        <source>As 0-9,12; a scale bar has two</source>
        <translation>Wie 0-9,12; ein Maßstab hat zwei</translation>
    </message>
    <message>
        <source>Size of a tag</source>
        <translation>Größe einer Marke</translation>
    </message>
    <message>
        <source>As tags.yaml declares it: the edge of the black square, corner 0 to corner 1</source>
        <translation>Wie in tags.yaml: die Kante des schwarzen Quadrats, Ecke 0 bis Ecke 1</translation>
    </message>
    <message>
        <source>Length of the scale bar</source>
        <translation>Länge des Maßstabs</translation>
    </message>
    <message>
        <source>Distance of the two tags&apos; centres</source>
        <translation>Abstand der Mitten beider Marken</translation>
    </message>
    <message>
        <source>Board</source>
        <translation>Tafel</translation>
    </message>
    <message>
        <source>A file, or one line:
checkerboard:9x6:0.025 (inner corners, square in m)
charuco:8x6:0.03:0.022:DICT_4X4_50 (squares, square and marker in m, dictionary)
aprilgrid:6x6:0.088:0.3 (tags, tag in m, gap / tag)
circles:4x11:0.02, asymmetric_circles:4x11:0.02 (columns x rows, spacing in m)</source>
        <translation>Eine Datei oder eine Zeile:
checkerboard:9x6:0.025 (innere Ecken, Quadrat in m)
charuco:8x6:0.03:0.022:DICT_4X4_50 (Quadrate, Quadrat und Marke in m, Wörterbuch)
aprilgrid:6x6:0.088:0.3 (Marken, Marke in m, Lücke / Marke)
circles:4x11:0.02, asymmetric_circles:4x11:0.02 (Spalten x Zeilen, Abstand in m)</translation>
    </message>
    <message>
        <source>Paper</source>
        <translation>Papier</translation>
    </message>
    <message>
        <source>A size by its name, or WIDTHxHEIGHT in mm as 300x500</source>
        <translation>Eine Größe beim Namen oder BREITExHÖHE in mm wie 300x500</translation>
    </message>
    <message>
        <source>Margin</source>
        <translation>Rand</translation>
    </message>
    <message>
        <source>Edge of the paper that the printer leaves white</source>
        <translation>Rand des Papiers, den der Drucker weiß lässt</translation>
    </message>
    <message>
        <source>Most tags on a sheet</source>
        <translation>Höchstzahl der Marken auf einem Bogen</translation>
    </message>
    <message>
        <source>as many as fit</source>
        <translation>so viele wie passen</translation>
    </message>
    <message>
        <source>File</source>
        <translation>Datei</translation>
    </message>
    <message>
        <source>The PDF, relative to the site&apos;s folder</source>
        <translation>Das PDF, bezogen auf den Ordner des Projekts</translation>
    </message>
    <message>
        <source>below print/, named by what it holds</source>
        <translation>unter print/, nach dem Inhalt benannt</translation>
    </message>
    <message>
        <source>Replace a changed PDF</source>
        <translation>Ein geändertes PDF ersetzen</translation>
    </message>
    <message>
        <source>Equivalent command line</source>
        <translation>Gleichwertige Befehlszeile</translation>
    </message>
    <message>
        <source>Print</source>
        <translation>Drucken</translation>
    </message>
    <message>
        <source>Ids</source>
        <translation>Nummern</translation>
    </message>
    <message>
        <source>Centre to centre</source>
        <translation>Mitte zu Mitte</translation>
    </message>
    <message>
        <source>Family</source>
        <translation>Familie</translation>
    </message>
    <message>
        <source>On a sheet</source>
        <translation>Auf einem Bogen</translation>
    </message>
    <message>
        <source>&amp;Write the PDF</source>
        <translation>PDF &amp;schreiben</translation>
    </message>
    <message>
        <source>And adds its tags to tags.yaml (trigpoint print)</source>
        <translation>Und trägt die Marken in tags.yaml ein (trigpoint print)</translation>
    </message>
    <message>
        <source>&amp;Open the PDF</source>
        <translation>PDF ö&amp;ffnen</translation>
    </message>
    <message>
        <source>Previous page</source>
        <translation>Vorige Seite</translation>
    </message>
    <message>
        <source>One page back</source>
        <translation>Eine Seite zurück</translation>
    </message>
    <message>
        <source>Next page</source>
        <translation>Nächste Seite</translation>
    </message>
    <message>
        <source>One page on</source>
        <translation>Eine Seite weiter</translation>
    </message>
    <message>
        <source>&amp;Enter</source>
        <translation>&amp;Eintragen</translation>
    </message>
    <message>
        <source>Corrects sizes_m in tags.yaml: size x measured / nominal</source>
        <translation>Berichtigt sizes_m in tags.yaml: Größe x gemessen / Soll</translation>
    </message>
    <message>
        <source>not measured</source>
        <translation>nicht gemessen</translation>
    </message>
    <message>
        <source>Printed for this site</source>
        <translation>Für dieses Projekt gedruckt</translation>
    </message>
    <message>
        <source>size (mm)</source>
        <translation>Größe (mm)</translation>
    </message>
    <message>
        <source>measured (mm)</source>
        <translation>gemessen (mm)</translation>
    </message>
    <message>
        <source>factor (%)</source>
        <translation>Faktor (%)</translation>
    </message>
    <message>
        <source>printed</source>
        <translation>gedruckt</translation>
    </message>
    <message>
        <source>family</source>
        <translation>Familie</translation>
    </message>
    <message>
        <source>file</source>
        <translation>Datei</translation>
    </message>
    <message>
        <source>ids</source>
        <translation>Nummern</translation>
    </message>
    <message>
        <source>that was asked for</source>
        <translation>die verlangte</translation>
    </message>
    <message>
        <source>size on the paper, from the bar&apos;s measured length; empty: not measured</source>
        <translation>Größe auf dem Papier, aus der gemessenen Strecke; leer: nicht gemessen</translation>
    </message>
    <message>
        <source>measured / asked for</source>
        <translation>gemessen / verlangt</translation>
    </message>
    <message>
        <source>when</source>
        <translation>wann</translation>
    </message>
    <message>
        <source>of the tags</source>
        <translation>der Marken</translation>
    </message>
    <message>
        <source>relative to the site&apos;s folder</source>
        <translation>bezogen auf den Ordner des Projekts</translation>
    </message>
    <message>
        <source>Page of the PDF</source>
        <translation>Seite des PDF</translation>
    </message>
    <message>
        <source>What to print</source>
        <translation>Was zu drucken ist</translation>
    </message>
    <message>
        <source>Measured on the paper</source>
        <translation>Auf dem Papier gemessen</translation>
    </message>
    <message>
        <source>Nominal</source>
        <translation>Soll</translation>
    </message>
    <message>
        <source>&amp;Enter for tags %1</source>
        <translation>Für Marken %1 &amp;eintragen</translation>
    </message>
    <message>
        <source>&amp;Enter for %1 tags</source>
        <translation>Für %1 Marken &amp;eintragen</translation>
    </message>
    <message>
        <source>No page; the form shows the reason.</source>
        <translation>Keine Seite: der Grund steht im Formular.</translation>
    </message>
    <message>
        <source>Open the folder of a site; its sheets are drawn here.</source>
        <translation>Den Ordner eines Projekts öffnen; seine Bögen werden hier gezeichnet.</translation>
    </message>
    <message>
        <source>Page %1 of %2, %3</source>
        <translation>Seite %1 von %2, %3</translation>
    </message>
    <message>
        <source>; at most %1 on a sheet</source>
        <translation>; höchstens %1 auf einem Bogen</translation>
    </message>
    <message>
        <source>; cut into %1 sheets</source>
        <translation>; in %1 Bögen zerschnitten</translation>
    </message>
    <message>
        <source>Nothing was printed.</source>
        <translation>Es wurde nichts gedruckt.</translation>
    </message>
    <message>
        <source>Measure: %1.</source>
        <translation>Messen: %1.</translation>
    </message>
    <message>
        <source>Tags added to tags.yaml: %1.</source>
        <translation>In tags.yaml eingetragene Marken: %1.</translation>
    </message>
    <message>
        <source>For distances.csv, measured: %1,%2,DISTANCE_M,SIGMA_M,control.</source>
        <translation>Für distances.csv, gemessen: %1,%2,ABSTAND_M,SIGMA_M,control.</translation>
    </message>
    <message>
        <source>Tags %1: %2 % of the size asked for; entered in tags.yaml.</source>
        <translation>Marken %1: %2 % der verlangten Größe; in tags.yaml eingetragen.</translation>
    </message>
    <message>
        <source>No length was entered.</source>
        <translation>Es wurde keine Länge eingetragen.</translation>
    </message>
    <message>
        <source>No program opens the PDF: %1</source>
        <translation>Kein Programm öffnet das PDF: %1</translation>
    </message>
    <message>
        <source>The PDF is not there any more: %1</source>
        <translation>Das PDF ist nicht mehr da: %1</translation>
    </message>
    <message>
        <source>As a ruler shows it</source>
        <translation>Wie das Lineal es zeigt</translation>
    </message>
    <message>
        <source>Measured across</source>
        <translation>Waagerecht gemessen</translation>
    </message>
    <message>
        <source>Measured up</source>
        <translation>Senkrecht gemessen</translation>
    </message>
    <message>
        <source>As it should be: of the bar, or of the tag&apos;s edge</source>
        <translation>Wie es sein soll: die Strecke oder die Kante der Marke</translation>
    </message>
    <message>
        <source>Across</source>
        <translation>Waagerecht</translation>
    </message>
    <message>
        <source>Up</source>
        <translation>Senkrecht</translation>
    </message>
    <message>
        <source>Nothing was printed yet.</source>
        <translation>Noch nichts gedruckt.</translation>
    </message>
    <message>
        <source>bars of %1 mm</source>
        <translation>Strecken von %1 mm</translation>
    </message>
    <message>
        <source>bars</source>
        <translation>Strecken</translation>
    </message>
    <message>
        <source>On these sheets: %1, tags of %2 mm. Half a millimetre on the ruler is %3 % of %4 mm.</source>
        <translation>Auf diesen Bögen: %1, Marken von %2 mm. Ein halber Millimeter am Lineal ist %3 % von %4 mm.</translation>
    </message>
    <message>
        <source> (one of %1)</source>
        <translation> (einer von %1)</translation>
    </message>
    <message>
        <source>%1, pages: %2. Print at 100 %, not fitted to the page. Bars: %3 mm.</source>
        <translation>%1, Seiten: %2. Mit 100 % drucken, nicht an die Seite angepasst. Strecken: %3 mm.</translation>
    </message>
    <message>
        <source>Sizes of the target for a calibration: times measured / nominal.</source>
        <translation>Maße der Tafel für eine Kalibrierung: mal gemessen / Soll.</translation>
    </message>
    <message>
        <source>One that was changed since it was written</source>
        <translation>Eines, das seit dem Schreiben geändert wurde</translation>
    </message>
    <message>
        <source>Drawing ...</source>
        <translation>Wird gezeichnet ...</translation>
    </message>
    <message>
        <source>The selected one, else the last one that was written</source>
        <translation>Das ausgewählte, sonst das zuletzt geschriebene</translation>
    </message>
</context>
<context>
    <name>trigpoint::ProblemBar</name>
    <message>
        <source>Problem</source>
        <translation>Problem</translation>
    </message>
    <message>
        <source>&amp;Details</source>
        <translation>&amp;Einzelheiten</translation>
    </message>
    <message>
        <source>C&amp;opy</source>
        <translation>K&amp;opieren</translation>
    </message>
    <message>
        <source>D&amp;ismiss</source>
        <translation>V&amp;erwerfen</translation>
    </message>
    <message>
        <source>Details of the problem</source>
        <translation>Einzelheiten des Problems</translation>
    </message>
    <message>
        <source>&amp;Details (%1)</source>
        <translation>&amp;Einzelheiten (%1)</translation>
    </message>
</context>
<context>
    <name>trigpoint::ReviewDesk</name>
    <message>
        <source>Object</source>
        <translation>Objekt</translation>
    </message>
    <message>
        <source>station:S57, detection:run1/images/000012.jpg#57, ... or select one elsewhere</source>
        <translation>station:S57, detection:run1/images/000012.jpg#57, ... oder anderswo eines wählen</translation>
    </message>
    <message>
        <source>Reason</source>
        <translation>Grund</translation>
    </message>
    <message>
        <source>User</source>
        <translation>Benutzer</translation>
    </message>
    <message>
        <source>you</source>
        <translation>Sie</translation>
    </message>
    <message>
        <source>&amp;Exclude</source>
        <translation>&amp;Ausschließen</translation>
    </message>
    <message>
        <source>Leave it out of what is solved and evaluated</source>
        <translation>Beim Lösen und Auswerten weglassen</translation>
    </message>
    <message>
        <source>&amp;Restore</source>
        <translation>&amp;Zurückholen</translation>
    </message>
    <message>
        <source>Take it in again</source>
        <translation>Wieder verwenden</translation>
    </message>
    <message>
        <source>Change &amp;role</source>
        <translation>&amp;Rolle ändern</translation>
    </message>
    <message>
        <source>Control point to check point, or back</source>
        <translation>Passpunkt zum Kontrollpunkt oder zurück</translation>
    </message>
    <message>
        <source>&amp;Undo last</source>
        <translation>Letzte &amp;rückgängig</translation>
    </message>
    <message>
        <source>Re-&amp;solve</source>
        <translation>Neu &amp;lösen</translation>
    </message>
    <message>
        <source>Make every result anew that rests on the review</source>
        <translation>Alle Ergebnisse neu rechnen, die auf der Prüfung beruhen</translation>
    </message>
    <message>
        <source>Variant to solve</source>
        <translation>Variante, die gelöst wird</translation>
    </message>
    <message>
        <source>Decisions</source>
        <translation>Entscheidungen</translation>
    </message>
    <message>
        <source>entry</source>
        <translation>Eintrag</translation>
    </message>
    <message>
        <source>time (UTC)</source>
        <translation>Zeit (UTC)</translation>
    </message>
    <message>
        <source>user</source>
        <translation>Benutzer</translation>
    </message>
    <message>
        <source>action</source>
        <translation>Entscheidung</translation>
    </message>
    <message>
        <source>object</source>
        <translation>Objekt</translation>
    </message>
    <message>
        <source>reason</source>
        <translation>Grund</translation>
    </message>
    <message>
        <source>What changed</source>
        <translation>Was sich geändert hat</translation>
    </message>
    <message>
        <source>reference</source>
        <translation>Referenz</translation>
    </message>
    <message>
        <source>run</source>
        <translation>Fahrt</translation>
    </message>
    <message>
        <source>station</source>
        <translation>Station</translation>
    </message>
    <message>
        <source>before</source>
        <translation>vorher</translation>
    </message>
    <message>
        <source>after</source>
        <translation>nachher</translation>
    </message>
    <message>
        <source>status before</source>
        <translation>Status vorher</translation>
    </message>
    <message>
        <source>status after</source>
        <translation>Status nachher</translation>
    </message>
    <message>
        <source>Re-solve to see what the review changes at stations and check points.</source>
        <translation>Neu lösen, um zu sehen, was die Prüfung an Stationen und Kontrollpunkten ändert.</translation>
    </message>
    <message>
        <source>Cancelled.</source>
        <translation>Abgebrochen.</translation>
    </message>
    <message>
        <source>Solving ...</source>
        <translation>Wird gelöst ...</translation>
    </message>
    <message>
        <source>first results</source>
        <translation>erste Ergebnisse</translation>
    </message>
    <message>
        <source>role %1</source>
        <translation>Rolle %1</translation>
    </message>
    <message>
        <source>undo %1</source>
        <translation>%1 zurückgenommen</translation>
    </message>
    <message>
        <source>Nothing changed at stations and check points.</source>
        <translation>An Stationen und Kontrollpunkten hat sich nichts geändert.</translation>
    </message>
    <message>
        <source>Take the last decision back (Ctrl+Z, where no text is written)</source>
        <translation>Die letzte Entscheidung zurücknehmen (Strg+Z, wo kein Text geschrieben wird)</translation>
    </message>
    <message>
        <source>Re&amp;do</source>
        <translation>&amp;Wiederholen</translation>
    </message>
    <message>
        <source>Make the decision again that was taken back last (Ctrl+Shift+Z)</source>
        <translation>Die zuletzt zurückgenommene Entscheidung erneut treffen (Strg+Umschalt+Z)</translation>
    </message>
    <message>
        <source>answer</source>
        <translation>Antwort</translation>
    </message>
    <message>
        <source>The last time it took %1.</source>
        <translation>Beim letzten Mal dauerte es %1.</translation>
    </message>
    <message>
        <source>1 sigma of the error in space, the larger of the two</source>
        <translation>1 Sigma des räumlichen Fehlers, das größere der beiden</translation>
    </message>
    <message>
        <source>changes within 1 sigma, too</source>
        <translation>auch Änderungen innerhalb von 1 Sigma</translation>
    </message>
    <message>
        <source>3D errors that changed by more than their 1 sigma, or in status: %1; by less: %2.</source>
        <translation>3D-Fehler, die sich um mehr als ihr 1 Sigma oder im Status geändert haben: %1; um weniger: %2.</translation>
    </message>
    <message>
        <source>Failed: %1</source>
        <translation>Fehlgeschlagen: %1</translation>
    </message>
    <message>
        <source>Solved. There was no evaluation before, so nothing is compared.</source>
        <translation>Gelöst. Vorher gab es keine Auswertung, deshalb wird nichts verglichen.</translation>
    </message>
    <message>
        <source>The results at stations and check points are still those of before.</source>
        <translation>Die Ergebnisse an Stationen und Kontrollpunkten sind noch die von vorher.</translation>
    </message>
    <message>
        <source>What the decision is about; what is selected on any desk is entered here</source>
        <translation>Worum es bei der Entscheidung geht; was auf irgendeinem Tisch gewählt ist, steht hier</translation>
    </message>
    <message>
        <source>Why; kept with the decision in review.jsonl</source>
        <translation>Warum; wird mit der Entscheidung in review.jsonl gespeichert</translation>
    </message>
    <message>
        <source>Who decides; kept with the decision. Empty: the name of your login</source>
        <translation>Wer entscheidet; wird mit der Entscheidung gespeichert. Leer: der Anmeldename</translation>
    </message>
    <message>
        <source>Variant whose results are made anew and compared</source>
        <translation>Variante, deren Ergebnisse neu gerechnet und verglichen werden</translation>
    </message>
    <message>
        <source>number of the decision in review.jsonl</source>
        <translation>Nummer der Entscheidung in review.jsonl</translation>
    </message>
    <message>
        <source>when it was decided, UTC</source>
        <translation>wann entschieden wurde, UTC</translation>
    </message>
    <message>
        <source>who decided</source>
        <translation>wer entschieden hat</translation>
    </message>
    <message>
        <source>exclude, restore, role or undo</source>
        <translation>exclude (ausschließen), restore (wieder aufnehmen), role (Rolle) oder undo (zurücknehmen)</translation>
    </message>
    <message>
        <source>what it is about</source>
        <translation>worum es geht</translation>
    </message>
    <message>
        <source>why; gray rows are no longer in force</source>
        <translation>warum; graue Zeilen gelten nicht mehr</translation>
    </message>
    <message>
        <source>what the answers are compared with</source>
        <translation>womit die Antworten verglichen werden</translation>
    </message>
    <message>
        <source>how the answer was made: panorama (G2) or view (G1)</source>
        <translation>wie die Antwort entstand: Panorama (G2) oder Ansicht (G1)</translation>
    </message>
    <message>
        <source>run that the panorama was localized against</source>
        <translation>Lauf, in dem das Panorama lokalisiert wurde</translation>
    </message>
    <message>
        <source>station or check point</source>
        <translation>Station oder Kontrollpunkt</translation>
    </message>
    <message>
        <source>3D error before the decisions</source>
        <translation>3D-Fehler vor den Entscheidungen</translation>
    </message>
    <message>
        <source>3D error after re-solving</source>
        <translation>3D-Fehler nach dem neuen Lösen</translation>
    </message>
    <message>
        <source>localized, refused, no match or no reference: before the decisions</source>
        <translation>lokalisiert, abgelehnt, nicht zugeordnet oder ohne Referenz: vor den Entscheidungen</translation>
    </message>
    <message>
        <source>localized, refused, no match or no reference: after re-solving</source>
        <translation>lokalisiert, abgelehnt, nicht zugeordnet oder ohne Referenz: nach dem neuen Lösen</translation>
    </message>
    <message>
        <source>Open a project (Ctrl+O) to exclude and restore what its results rest on.</source>
        <translation>Ein Projekt öffnen (Strg+O), um auszuschließen und wieder aufzunehmen, worauf seine Ergebnisse beruhen.</translation>
    </message>
</context>
<context>
    <name>trigpoint::RunDesk</name>
    <message>
        <source>Stage</source>
        <translation>Stufe</translation>
    </message>
    <message>
        <source>Runs</source>
        <translation>Fahrten</translation>
    </message>
    <message>
        <source>Variant</source>
        <translation>Variante</translation>
    </message>
    <message>
        <source>A second set of results beside the first; empty: the first</source>
        <translation>Ein zweiter Satz von Ergebnissen neben dem ersten; leer: der erste</translation>
    </message>
    <message>
        <source>Threads</source>
        <translation>Threads</translation>
    </message>
    <message>
        <source>all cores</source>
        <translation>alle Kerne</translation>
    </message>
    <message>
        <source>Seed</source>
        <translation>Startwert</translation>
    </message>
    <message>
        <source>Options</source>
        <translation>Optionen</translation>
    </message>
    <message>
        <source>Equivalent command line</source>
        <translation>Gleichwertige Befehlszeile</translation>
    </message>
    <message>
        <source>Copy</source>
        <translation>Kopieren</translation>
    </message>
    <message>
        <source>Copy the command line</source>
        <translation>Die Befehlszeile kopieren</translation>
    </message>
    <message>
        <source>What is wrong with the options</source>
        <translation>Was an den Optionen falsch ist</translation>
    </message>
    <message>
        <source>&amp;Run</source>
        <translation>&amp;Ausführen</translation>
    </message>
    <message>
        <source>Run</source>
        <translation>Ausführen</translation>
    </message>
    <message>
        <source>&amp;Cancel</source>
        <translation>&amp;Abbrechen</translation>
    </message>
    <message>
        <source>Cancel the run</source>
        <translation>Die Berechnung abbrechen</translation>
    </message>
    <message>
        <source>Reset options</source>
        <translation>Optionen zurücksetzen</translation>
    </message>
    <message>
        <source>Progress</source>
        <translation>Fortschritt</translation>
    </message>
    <message>
        <source>Nothing runs.</source>
        <translation>Es läuft nichts.</translation>
    </message>
    <message>
        <source>State of the run</source>
        <translation>Stand der Berechnung</translation>
    </message>
    <message>
        <source>Log</source>
        <translation>Protokoll</translation>
    </message>
    <message>
        <source>Command</source>
        <translation>Befehl</translation>
    </message>
    <message>
        <source>all that is out of date</source>
        <translation>alles, was veraltet ist</translation>
    </message>
    <message>
        <source>Stopping ...</source>
        <translation>Wird angehalten ...</translation>
    </message>
    <message>
        <source>Photo sets</source>
        <translation>Fotosätze</translation>
    </message>
    <message>
        <source>Name</source>
        <translation>Name</translation>
    </message>
    <message>
        <source>Project %1: </source>
        <translation>Projekt %1: </translation>
    </message>
    <message>
        <source>, %1 of %2</source>
        <translation>, %1 von %2</translation>
    </message>
    <message>
        <source>, %1 left</source>
        <translation>, noch %1</translation>
    </message>
    <message>
        <source>Done.</source>
        <translation>Fertig.</translation>
    </message>
    <message>
        <source>Cancelled; finished stages are kept.</source>
        <translation>Abgebrochen; fertige Stufen bleiben erhalten.</translation>
    </message>
    <message>
        <source>Failed: %1</source>
        <translation>Fehlgeschlagen: %1</translation>
    </message>
    <message>
        <source>How long it took the last time</source>
        <translation>Wie lange es beim letzten Mal dauerte</translation>
    </message>
    <message>
        <source>Results and their states</source>
        <translation>Ergebnisse und ihr Zustand</translation>
    </message>
    <message>
        <source>result</source>
        <translation>Ergebnis</translation>
    </message>
    <message>
        <source>state</source>
        <translation>Zustand</translation>
    </message>
    <message>
        <source>metric</source>
        <translation>Kennzahl</translation>
    </message>
    <message>
        <source>time (s)</source>
        <translation>Zeit (s)</translation>
    </message>
    <message>
        <source>Results that are computed again: %1.</source>
        <translation>Ergebnisse, die neu berechnet werden: %1.</translation>
    </message>
    <message>
        <source>The last time that took %1.</source>
        <translation>Beim letzten Mal dauerte das %1.</translation>
    </message>
    <message>
        <source>Never made before: %1.</source>
        <translation>Noch nie erstellt: %1.</translation>
    </message>
    <message>
        <source>Run it now?</source>
        <translation>Jetzt ausführen?</translation>
    </message>
    <message>
        <source>; of all about %1</source>
        <translation>; insgesamt etwa %1</translation>
    </message>
    <message>
        <source>How long it takes is not known yet: %1 results are still checked; they took %2.</source>
        <translation>Wie lange es dauert, ist noch nicht bekannt: %1 Ergebnisse werden noch geprüft; sie dauerten %2.</translation>
    </message>
    <message>
        <source>In the order in which each needs those above it; Return or a double click chooses the stage</source>
        <translation>In der Reihenfolge, in der jede die darüber braucht; Eingabe oder Doppelklick wählt die Stufe</translation>
    </message>
    <message>
        <source>Stages and results</source>
        <translation>Stufen und Ergebnisse</translation>
    </message>
    <message>
        <source>Stages</source>
        <translation>Stufen</translation>
    </message>
    <message>
        <source>Results</source>
        <translation>Ergebnisse</translation>
    </message>
    <message>
        <source>; of all at least %1</source>
        <translation>; von allen mindestens %1</translation>
    </message>
    <message>
        <source>Those that are ticked are run; all ticked: also runs that are added later</source>
        <translation>Die angekreuzten werden gerechnet; alle angekreuzt: auch später hinzugefügte Fahrten</translation>
    </message>
    <message>
        <source>What is made: one stage, or all that is out of date</source>
        <translation>Was gerechnet wird: eine Stufe oder alles, was nicht aktuell ist</translation>
    </message>
    <message>
        <source>How many threads compute; 0: one for each core. The results do not depend on it</source>
        <translation>Wie viele Threads rechnen; 0: je Kern einer. Die Ergebnisse hängen nicht davon ab</translation>
    </message>
    <message>
        <source>Where random numbers begin. Another seed makes every result anew</source>
        <translation>Womit Zufallszahlen beginnen. Ein anderer Startwert rechnet jedes Ergebnis neu</translation>
    </message>
    <message>
        <source>stage, and the run, photo set or variant that it is made for</source>
        <translation>Stufe, und die Fahrt, der Fotosatz oder die Variante, für die sie gerechnet wird</translation>
    </message>
    <message>
        <source>done, out of date, failed, running, missing, or not needed</source>
        <translation>fertig, nicht aktuell, fehlgeschlagen, läuft, fehlt oder nicht nötig</translation>
    </message>
    <message>
        <source>main number of the result; lengths in metres</source>
        <translation>wichtigste Zahl des Ergebnisses; Längen in Metern</translation>
    </message>
    <message>
        <source>seconds that it took the last time</source>
        <translation>Sekunden, die es beim letzten Mal dauerte</translation>
    </message>
</context>
<context>
    <name>trigpoint::SceneDesk</name>
    <message>
        <source>E %1  N %2  U %3 %4</source>
        <translation>E %1  N %2  U %3 %4</translation>
    </message>
    <message>
        <source>x %1  y %2  z %3 %4</source>
        <translation>x %1  y %2  z %3 %4</translation>
    </message>
    <message>
        <source>from %1</source>
        <translation>von %1</translation>
    </message>
    <message>
        <source>horizontal %1, height difference %2</source>
        <translation>horizontal %1, Höhenunterschied %2</translation>
    </message>
    <message>
        <source>, azimuth %1 deg</source>
        <translation>, Richtungswinkel %1 Grad</translation>
    </message>
    <message>
        <source>Save the measurements</source>
        <translation>Die Messungen speichern</translation>
    </message>
    <message>
        <source>CSV (*.csv)</source>
        <translation>CSV (*.csv)</translation>
    </message>
    <message>
        <source>aerial</source>
        <translation>Luftbild</translation>
    </message>
    <message>
        <source>odometry</source>
        <translation>Odometrie</translation>
    </message>
    <message>
        <source>optimised</source>
        <translation>optimiert</translation>
    </message>
    <message>
        <source>truth</source>
        <translation>Wahrheit</translation>
    </message>
    <message>
        <source>estimates</source>
        <translation>andere Systeme</translation>
    </message>
    <message>
        <source>points</source>
        <translation>Punkte</translation>
    </message>
    <message>
        <source>cameras</source>
        <translation>Kameras</translation>
    </message>
    <message>
        <source>panoramas</source>
        <translation>Panoramen</translation>
    </message>
    <message>
        <source>geotags</source>
        <translation>Geotags</translation>
    </message>
    <message>
        <source>tags</source>
        <translation>Marken</translation>
    </message>
    <message>
        <source>errors</source>
        <translation>Fehler</translation>
    </message>
    <message>
        <source>ellipsoids</source>
        <translation>Ellipsoide</translation>
    </message>
    <message>
        <source>labels</source>
        <translation>Beschriftung</translation>
    </message>
    <message>
        <source>axes</source>
        <translation>Achsen</translation>
    </message>
    <message>
        <source>legend</source>
        <translation>Legende</translation>
    </message>
    <message>
        <source>How the mouse moves the view</source>
        <translation>Wie die Maus die Ansicht bewegt</translation>
    </message>
    <message>
        <source>orbit</source>
        <translation>drehen</translation>
    </message>
    <message>
        <source>fly</source>
        <translation>fliegen</translation>
    </message>
    <message>
        <source>plan</source>
        <translation>Lageplan</translation>
    </message>
    <message>
        <source>Colour of the points</source>
        <translation>Farbe der Punkte</translation>
    </message>
    <message>
        <source>points by height</source>
        <translation>Punkte nach Höhe</translation>
    </message>
    <message>
        <source>points by track length</source>
        <translation>Punkte nach Länge der Spur</translation>
    </message>
    <message>
        <source>points by uncertainty</source>
        <translation>Punkte nach Unsicherheit</translation>
    </message>
    <message>
        <source>Variant</source>
        <translation>Variante</translation>
    </message>
    <message>
        <source>Run to move along</source>
        <translation>Fahrt, der man folgt</translation>
    </message>
    <message>
        <source>Layers</source>
        <translation>Ebenen</translation>
    </message>
    <message>
        <source>follow camera</source>
        <translation>der Kamera folgen</translation>
    </message>
    <message>
        <source>measure</source>
        <translation>messen</translation>
    </message>
    <message>
        <source>Two clicks on things of the scene: the distance between them</source>
        <translation>Zwei Klicks auf Dinge der Szene: der Abstand zwischen ihnen</translation>
    </message>
    <message>
        <source>Step &amp;inside</source>
        <translation>&amp;Hineingehen</translation>
    </message>
    <message>
        <source>Stand in the selected panorama and see points and tags drawn over it</source>
        <translation>Im gewählten Panorama stehen und darübergezeichnete Punkte und Marken sehen</translation>
    </message>
    <message>
        <source>Screen&amp;shot ...</source>
        <translation>Bildschirm&amp;foto ...</translation>
    </message>
    <message>
        <source>Place along the run</source>
        <translation>Ort entlang der Fahrt</translation>
    </message>
    <message>
        <source>Coordinates under the mouse</source>
        <translation>Koordinaten unter der Maus</translation>
    </message>
    <message>
        <source>On the ground under the mouse; Ctrl+C in the view copies it</source>
        <translation>Auf dem Boden unter der Maus; Strg+C in der Ansicht kopiert sie</translation>
    </message>
    <message>
        <source>Opacity of the chosen layer</source>
        <translation>Deckkraft der gewählten Ebene</translation>
    </message>
    <message>
        <source>Size of the points</source>
        <translation>Größe der Punkte</translation>
    </message>
    <message>
        <source>Image of what is picked</source>
        <translation>Bild des Gewählten</translation>
    </message>
    <message>
        <source>Scene</source>
        <translation>Szene</translation>
    </message>
    <message>
        <source>opacity</source>
        <translation>Deckkraft</translation>
    </message>
    <message>
        <source>Select a localized panorama first.</source>
        <translation>Zuerst ein lokalisiertes Panorama wählen.</translation>
    </message>
    <message>
        <source>Screenshot</source>
        <translation>Bildschirmfoto</translation>
    </message>
    <message>
        <source>Width x height, pixels</source>
        <translation>Breite x Höhe, Pixel</translation>
    </message>
    <message>
        <source>&apos;%1&apos; is no size; expected something like 1920x1080</source>
        <translation>„%1“ ist keine Größe; erwartet wird etwas wie 1920x1080</translation>
    </message>
    <message>
        <source>Save the screenshot</source>
        <translation>Das Bildschirmfoto speichern</translation>
    </message>
    <message>
        <source>%1: cannot be written</source>
        <translation>%1: lässt sich nicht schreiben</translation>
    </message>
    <message>
        <source>first results</source>
        <translation>erste Ergebnisse</translation>
    </message>
    <message>
        <source>The scene is not shown.</source>
        <translation>Die Szene wird nicht gezeigt.</translation>
    </message>
    <message>
        <source>Nothing to show yet: run localize.</source>
        <translation>Noch nichts zu zeigen: localize ausführen.</translation>
    </message>
    <message>
        <source>frame: %1</source>
        <translation>Koordinatensystem: %1</translation>
    </message>
    <message>
        <source>seen by %1</source>
        <translation>gesehen von %1</translation>
    </message>
    <message>
        <source>The panorama is not shown.</source>
        <translation>Das Panorama wird nicht gezeigt.</translation>
    </message>
    <message>
        <source>Step &amp;outside</source>
        <translation>&amp;Hinausgehen</translation>
    </message>
    <message>
        <source>inside %1, as localized by %2; drag to look around, wheel: zoom, Page Up and Page Down: the others</source>
        <translation>in %1, wie von %2 lokalisiert; Ziehen: umsehen, Mausrad: Zoom, Bild auf und Bild ab: die anderen</translation>
    </message>
    <message>
        <source>gps</source>
        <translation>GPS</translation>
    </message>
    <message>
        <source>control</source>
        <translation>Passpunkte</translation>
    </message>
    <message>
        <source>tag ellipsoids</source>
        <translation>Ellipsoide der Marken</translation>
    </message>
    <message>
        <source>camera ellipsoids</source>
        <translation>Ellipsoide der Kameras</translation>
    </message>
    <message>
        <source>points by residual</source>
        <translation>Punkte nach Residuum</translation>
    </message>
    <message>
        <source>points as in the pictures</source>
        <translation>Punkte wie in den Bildern</translation>
    </message>
    <message>
        <source>Runs that are shown, on all layers</source>
        <translation>Gezeigte Fahrten, auf allen Ebenen</translation>
    </message>
    <message>
        <source>by percentile</source>
        <translation>nach Perzentil</translation>
    </message>
    <message>
        <source>Spreads the colours evenly over the points, so that outliers do not use up the scale</source>
        <translation>Farben gleichmäßig über die Punkte, damit Ausreißer sie nicht aufbrauchen</translation>
    </message>
    <message>
        <source>depth shading</source>
        <translation>Tiefenschattierung</translation>
    </message>
    <message>
        <source>Outlines what stands before something else (eye-dome lighting), while the view rests</source>
        <translation>Umrandet, was vor anderem steht (Eye-Dome-Lighting), solange die Ansicht ruht</translation>
    </message>
    <message>
        <source>Only points that at least so many images see</source>
        <translation>Nur Punkte, die mindestens so viele Bilder sehen</translation>
    </message>
    <message>
        <source>any</source>
        <translation>beliebig</translation>
    </message>
    <message>
        <source>Only points whose 1 sigma (largest axis, cameras held) is at most this</source>
        <translation>Nur Punkte, deren 1 Sigma (größte Achse, Kameras fest) höchstens so groß ist</translation>
    </message>
    <message>
        <source>Only points whose mean reprojection error is at most so many pixels</source>
        <translation>Nur Punkte, deren mittlerer Rückprojektionsfehler höchstens so viele Pixel beträgt</translation>
    </message>
    <message>
        <source>The run&apos;s previous panorama (Page Up)</source>
        <translation>Das vorige Panorama der Fahrt (Bild auf)</translation>
    </message>
    <message>
        <source>The run&apos;s next panorama (Page Down)</source>
        <translation>Das nächste Panorama der Fahrt (Bild ab)</translation>
    </message>
    <message>
        <source>The run by which this panorama is localized</source>
        <translation>Die Fahrt, durch die dieses Panorama lokalisiert ist</translation>
    </message>
    <message>
        <source>size</source>
        <translation>Größe</translation>
    </message>
    <message>
        <source>images, at least</source>
        <translation>Bilder, mindestens</translation>
    </message>
    <message>
        <source>, at most</source>
        <translation>, höchstens</translation>
    </message>
    <message>
        <source>residual, at most</source>
        <translation>Residuum, höchstens</translation>
    </message>
    <message>
        <source>How the scene is drawn</source>
        <translation>Wie die Szene gezeichnet wird</translation>
    </message>
    <message>
        <source>Points</source>
        <translation>Punkte</translation>
    </message>
    <message>
        <source>%1 of %2 points</source>
        <translation>%1 von %2 Punkten</translation>
    </message>
    <message>
        <source>Reading the points&apos; colours from the pictures ...</source>
        <translation>Farben der Punkte werden aus den Bildern gelesen ...</translation>
    </message>
    <message>
        <source>site, E and N in %1</source>
        <translation>Messgebiet, E und N in %1</translation>
    </message>
    <message>
        <source>x and y in %1</source>
        <translation>x und y in %1</translation>
    </message>
    <message>
        <source>Notes on the scene</source>
        <translation>Hinweise zur Szene</translation>
    </message>
    <message>
        <source>%1 is not in the scene.</source>
        <translation>%1 ist nicht in der Szene.</translation>
    </message>
    <message>
        <source>%1 is not in the scene; what belongs to it is:</source>
        <translation>%1 ist nicht in der Szene; was dazu gehört, ist darin:</translation>
    </message>
    <message>
        <source>The two are in different frames and do not lie over each other: %1, and %2.</source>
        <translation>Die beiden sind in verschiedenen Bezugssystemen und liegen nicht übereinander: %1 und %2.</translation>
    </message>
    <message>
        <source>The origins of the two are %1 apart: the same place is not drawn at the same place.</source>
        <translation>Die Ursprünge der beiden liegen %1 auseinander: derselbe Ort wird nicht am selben Ort gezeichnet.</translation>
    </message>
    <message>
        <source>%1 by %2</source>
        <translation>%1 durch %2</translation>
    </message>
    <message>
        <source>tag %1</source>
        <translation>Marke %1</translation>
    </message>
    <message>
        <source>geotag of %1</source>
        <translation>Geotag von %1</translation>
    </message>
    <message>
        <source>surveyed point %1</source>
        <translation>vermessener Punkt %1</translation>
    </message>
    <message>
        <source>point %1 of %2</source>
        <translation>Punkt %1 von %2</translation>
    </message>
    <message>
        <source>%1 of %2</source>
        <translation>%1 von %2</translation>
    </message>
    <message>
        <source>reference of %1 (%2)</source>
        <translation>Referenz von %1 (%2)</translation>
    </message>
    <message>
        <source>The two places are taken as independent.</source>
        <translation>Die beiden Orte gelten als unabhängig.</translation>
    </message>
    <message>
        <source>%1 from %2 to %3</source>
        <translation>%1 von %2 nach %3</translation>
    </message>
    <message>
        <source>reference</source>
        <translation>Referenz</translation>
    </message>
    <message>
        <source>Save m&amp;easurements ...</source>
        <translation>M&amp;essungen speichern ...</translation>
    </message>
    <message>
        <source>The list of measurements with their sigmas, as CSV</source>
        <translation>Die Liste der Messungen mit ihren Sigmas, als CSV</translation>
    </message>
    <message>
        <source>Open a project (Ctrl+O): its scene is drawn here.</source>
        <translation>Ein Projekt öffnen (Strg+O): seine Szene wird hier gezeichnet.</translation>
    </message>
</context>
<context>
    <name>trigpoint::ServicesDialog</name>
    <message>
        <source>Panoramas of services</source>
        <translation>Panoramen von Diensten</translation>
    </message>
    <message>
        <source>Equivalent command line</source>
        <translation>Gleichwertige Befehlszeile</translation>
    </message>
    <message>
        <source>Search lists what a service has along the run; it downloads nothing.</source>
        <translation>Die Suche zeigt, was ein Dienst entlang der Fahrt hat; geladen wird dabei nichts.</translation>
    </message>
    <message>
        <source>Pick all</source>
        <translation>Alle wählen</translation>
    </message>
    <message>
        <source>Pick none</source>
        <translation>Keine wählen</translation>
    </message>
    <message>
        <source>Search</source>
        <translation>Suchen</translation>
    </message>
    <message>
        <source>Download</source>
        <translation>Laden</translation>
    </message>
    <message>
        <source>Cancel</source>
        <translation>Abbrechen</translation>
    </message>
    <message>
        <source>Close</source>
        <translation>Schließen</translation>
    </message>
    <message>
        <source>2024, 2024-05 or 2024-05-12</source>
        <translation>2024, 2024-05 oder 2024-05-12</translation>
    </message>
    <message>
        <source>the public one</source>
        <translation>der öffentliche</translation>
    </message>
    <message>
        <source>My agreement with the service permits computing from its pictures</source>
        <translation>Meine Vereinbarung mit dem Dienst erlaubt es, mit seinen Bildern zu rechnen</translation>
    </message>
    <message>
        <source>Service</source>
        <translation>Dienst</translation>
    </message>
    <message>
        <source>Along run, within</source>
        <translation>Entlang der Fahrt, bis</translation>
    </message>
    <message>
        <source>Taken since, until</source>
        <translation>Aufgenommen ab, bis</translation>
    </message>
    <message>
        <source>File with the key</source>
        <translation>Datei mit dem Schlüssel</translation>
    </message>
    <message>
        <source>Server</source>
        <translation>Server</translation>
    </message>
    <message>
        <source>Panoramas that were found</source>
        <translation>Gefundene Panoramen</translation>
    </message>
    <message>
        <source>Pick</source>
        <translation>Wahl</translation>
    </message>
    <message>
        <source>Source</source>
        <translation>Quelle</translation>
    </message>
    <message>
        <source>Panorama</source>
        <translation>Panorama</translation>
    </message>
    <message>
        <source>Taken</source>
        <translation>Aufgenommen</translation>
    </message>
    <message>
        <source>Away</source>
        <translation>Abstand</translation>
    </message>
    <message>
        <source>Heading</source>
        <translation>Richtung</translation>
    </message>
    <message>
        <source>Width</source>
        <translation>Breite</translation>
    </message>
    <message>
        <source>Licence</source>
        <translation>Lizenz</translation>
    </message>
    <message>
        <source>Owner</source>
        <translation>Urheber</translation>
    </message>
    <message>
        <source>Searching ...</source>
        <translation>Suche läuft ...</translation>
    </message>
    <message>
        <source>%1 has %2 panoramas there.</source>
        <translation>%1 hat dort %2 Panoramen.</translation>
    </message>
    <message>
        <source>Loading ...</source>
        <translation>Lädt ...</translation>
    </message>
    <message>
        <source>empty: the environment variable %1</source>
        <translation>leer: die Umgebungsvariable %1</translation>
    </message>
    <message>
        <source>none is needed</source>
        <translation>keiner nötig</translation>
    </message>
    <message>
        <source>Download %1</source>
        <translation>%1 laden</translation>
    </message>
    <message>
        <source>Picked panoramas are downloaded</source>
        <translation>Gewählte Panoramen werden geladen</translation>
    </message>
    <message>
        <source>Service that has the panorama</source>
        <translation>Dienst, der das Panorama hat</translation>
    </message>
    <message>
        <source>Name of the panorama at its service</source>
        <translation>Name des Panoramas bei seinem Dienst</translation>
    </message>
    <message>
        <source>Day on which the panorama was taken</source>
        <translation>Tag, an dem das Panorama aufgenommen wurde</translation>
    </message>
    <message>
        <source>Distance from the run&apos;s path, in the unit shown</source>
        <translation>Abstand vom Weg des Laufs, in der gezeigten Einheit</translation>
    </message>
    <message>
        <source>Direction of the panorama&apos;s centre as the service states it, clockwise from true north (deg)</source>
        <translation>Richtung der Mitte des Panoramas nach Angabe des Dienstes, im Uhrzeigersinn von geographisch Nord (Grad)</translation>
    </message>
    <message>
        <source>Width of the picture at the service (px)</source>
        <translation>Breite des Bilds beim Dienst (px)</translation>
    </message>
    <message>
        <source>Licence under which the picture may be used</source>
        <translation>Lizenz, unter der das Bild benutzt werden darf</translation>
    </message>
    <message>
        <source>Who took the picture</source>
        <translation>Wer das Bild aufgenommen hat</translation>
    </message>
</context>
<context>
    <name>trigpoint::ServicesMap</name>
    <message>
        <source>Map of the run and of the panoramas that services have</source>
        <translation>Karte der Fahrt und der Panoramen, die Dienste haben</translation>
    </message>
    <message>
        <source>N up</source>
        <translation>N oben</translation>
    </message>
</context>
<context>
    <name>trigpoint::SiteTree</name>
    <message>
        <source>Site</source>
        <translation>Messgebiet</translation>
    </message>
    <message>
        <source>site</source>
        <translation>Messgebiet</translation>
    </message>
    <message>
        <source>state</source>
        <translation>Stand</translation>
    </message>
    <message>
        <source>excluded</source>
        <translation>ausgeschlossen</translation>
    </message>
    <message>
        <source>runs (%1)</source>
        <translation>Fahrten (%1)</translation>
    </message>
    <message>
        <source>%1 images</source>
        <translation>%1 Bilder</translation>
    </message>
    <message>
        <source>broken</source>
        <translation>defekt</translation>
    </message>
    <message>
        <source>panoramas (%1)</source>
        <translation>Panoramen (%1)</translation>
    </message>
    <message>
        <source>photos (%1)</source>
        <translation>Fotos (%1)</translation>
    </message>
    <message>
        <source>sets (%1)</source>
        <translation>Sätze (%1)</translation>
    </message>
    <message>
        <source>stations (%1)</source>
        <translation>Stationen (%1)</translation>
    </message>
    <message>
        <source>tag %1</source>
        <translation>Marke %1</translation>
    </message>
    <message>
        <source>tags (%1)</source>
        <translation>Marken (%1)</translation>
    </message>
    <message>
        <source>control (%1)</source>
        <translation>Passpunkte (%1)</translation>
    </message>
    <message>
        <source>results</source>
        <translation>Ergebnisse</translation>
    </message>
    <message>
        <source>checking ...</source>
        <translation>wird geprüft ...</translation>
    </message>
    <message>
        <source>Run ...</source>
        <translation>Ausführen ...</translation>
    </message>
    <message>
        <source>missing</source>
        <translation>fehlt</translation>
    </message>
    <message>
        <source>done</source>
        <translation>fertig</translation>
    </message>
    <message>
        <source>out of date</source>
        <translation>veraltet</translation>
    </message>
    <message>
        <source>failed</source>
        <translation>fehlgeschlagen</translation>
    </message>
    <message>
        <source>running</source>
        <translation>läuft</translation>
    </message>
    <message>
        <source>not needed</source>
        <translation>nicht nötig</translation>
    </message>
</context>
<context>
    <name>trigpoint::StageForm</name>
    <message>
        <source>from %1</source>
        <translation>von %1</translation>
    </message>
    <message>
        <source>to %1</source>
        <translation>bis %1</translation>
    </message>
    <message>
        <source>This stage has no options.</source>
        <translation>Diese Stufe hat keine Optionen.</translation>
    </message>
    <message>
        <source>default %1</source>
        <translation>Vorgabe %1</translation>
    </message>
    <message>
        <source>Find an option</source>
        <translation>Option finden</translation>
    </message>
    <message>
        <source>find an option by name or meaning</source>
        <translation>Option nach Name oder Bedeutung finden</translation>
    </message>
</context>
<context>
    <name>trigpoint::StageGraph</name>
    <message>
        <source>Stages and what they need</source>
        <translation>Stufen und was sie brauchen</translation>
    </message>
    <message>
        <source>%1 of %2 done</source>
        <translation>%1 von %2 fertig</translation>
    </message>
    <message>
        <source>worst: %1</source>
        <translation>schlechtester Zustand: %1</translation>
    </message>
    <message>
        <source>in all</source>
        <translation>insgesamt</translation>
    </message>
    <message>
        <source>at most</source>
        <translation>höchstens</translation>
    </message>
    <message>
        <source>Each stage below those whose results it needs; click to choose</source>
        <translation>Jede Stufe unter denen, deren Ergebnisse sie braucht; ein Klick wählt sie</translation>
    </message>
</context>
<context>
    <name>trigpoint::StationCard</name>
    <message>
        <source>also each &amp;view (G1)</source>
        <translation>auch jede &amp;Ansicht (G1)</translation>
    </message>
    <message>
        <source>Besides the final answers, panorama (G2), those of each rectilinear view by itself</source>
        <translation>Neben den endgültigen Antworten, Panorama (G2), die jeder geradlinigen Ansicht für sich</translation>
    </message>
    <message>
        <source>Errors of the selected station</source>
        <translation>Fehler der gewählten Station</translation>
    </message>
    <message>
        <source>Show in &amp;3D</source>
        <translation>In &amp;3D zeigen</translation>
    </message>
    <message>
        <source>Best &amp;image</source>
        <translation>Bestes &amp;Bild</translation>
    </message>
    <message>
        <source>&amp;Decide ...</source>
        <translation>&amp;Entscheiden ...</translation>
    </message>
    <message>
        <source>Select a station: in the plan, a table, a chart, the scene, or the tree.</source>
        <translation>Eine Station wählen: im Plan, in einer Tabelle, einem Diagramm, der Szene oder im Baum.</translation>
    </message>
    <message>
        <source>, tag %1</source>
        <translation>, Marke %1</translation>
    </message>
    <message>
        <source>Station %1%2</source>
        <translation>Station %1%2</translation>
    </message>
    <message>
        <source>Panorama %1%2</source>
        <translation>Panorama %1%2</translation>
    </message>
    <message>
        <source>run</source>
        <translation>Fahrt</translation>
    </message>
    <message>
        <source>3D</source>
        <translation>3D</translation>
    </message>
    <message>
        <source>NEES/dof</source>
        <translation>NEES/FG</translation>
    </message>
    <message>
        <source>run, and what was answered</source>
        <translation>Fahrt und Ergebnis</translation>
    </message>
    <message>
        <source>error in space (%1)</source>
        <translation>Fehler im Raum (%1)</translation>
    </message>
    <message>
        <source>error to the east (%1)</source>
        <translation>Fehler nach Osten (%1)</translation>
    </message>
    <message>
        <source>error to the north (%1)</source>
        <translation>Fehler nach Norden (%1)</translation>
    </message>
    <message>
        <source>error upwards (%1)</source>
        <translation>Fehler nach oben (%1)</translation>
    </message>
    <message>
        <source>1 sigma of the difference in space (%1)</source>
        <translation>1 Sigma der Differenz im Raum (%1)</translation>
    </message>
    <message>
        <source>the tolerance that the error keeps, of 0.1, 0.25, 0.5 and 1 m (%1)</source>
        <translation>die Toleranz, die der Fehler einhält, von 0,1, 0,25, 0,5 und 1 m (%1)</translation>
    </message>
    <message>
        <source>squared error in its own sigmas, by degrees of freedom: about 1 if the sigmas are right</source>
        <translation>quadrierter Fehler in den eigenen Sigmas je Freiheitsgrad: etwa 1, wenn die Sigmas stimmen</translation>
    </message>
    <message>
        <source>Lengths in %1. Absolute: in site coordinates (east, north, up), with the georeference&apos;s error. Relative: in the run&apos;s own frame.</source>
        <translation>Längen in %1. Absolut: in Koordinaten des Messgebiets (Ost, Nord, oben), mit dem Fehler der Georeferenz. Relativ: im eigenen System der Fahrt.</translation>
    </message>
    <message>
        <source>none</source>
        <translation>keine</translation>
    </message>
    <message>
        <source> (largest axis)</source>
        <translation> (größte Achse)</translation>
    </message>
    <message>
        <source>Results: %1.</source>
        <translation>Ergebnisse: %1.</translation>
    </message>
    <message>
        <source>the first ones</source>
        <translation>die ersten</translation>
    </message>
    <message>
        <source>variant %1</source>
        <translation>Variante %1</translation>
    </message>
    <message>
        <source>No run answers it: run localize.</source>
        <translation>Keine Fahrt beantwortet sie: localize ausführen.</translation>
    </message>
    <message>
        <source>There is no reference to compare its answers with.</source>
        <translation>Es gibt keine Referenz, mit der ihre Antworten verglichen werden.</translation>
    </message>
    <message>
        <source>Its answers are not compared yet: run evaluate.</source>
        <translation>Ihre Antworten sind noch nicht verglichen: evaluate ausführen.</translation>
    </message>
    <message>
        <source>Its answers are not compared: ground truth is missing (stations.csv, and tags.yaml or control_points.csv).</source>
        <translation>Ihre Antworten sind nicht verglichen: Die Sollwerte fehlen (stations.csv, dazu tags.yaml oder control_points.csv).</translation>
    </message>
    <message>
        <source>tol.</source>
        <translation>Tol.</translation>
    </message>
</context>
<context>
    <name>trigpoint::TablesDesk</name>
    <message>
        <source>Tables</source>
        <translation>Tabellen</translation>
    </message>
    <message>
        <source>Filter of the rows</source>
        <translation>Filter der Zeilen</translation>
    </message>
    <message>
        <source>filter</source>
        <translation>Filter</translation>
    </message>
    <message>
        <source>&amp;Copy</source>
        <translation>&amp;Kopieren</translation>
    </message>
    <message>
        <source>Copy the selected rows (Ctrl+C)</source>
        <translation>Die gewählten Zeilen kopieren (Strg+C)</translation>
    </message>
    <message>
        <source>&amp;Export ...</source>
        <translation>&amp;Exportieren ...</translation>
    </message>
    <message>
        <source>Co&amp;lumns ...</source>
        <translation>S&amp;palten ...</translation>
    </message>
    <message>
        <source>Choose the columns that are shown; also by a right click on the header</source>
        <translation>Die gezeigten Spalten wählen; auch mit Rechtsklick auf die Kopfzeile</translation>
    </message>
    <message>
        <source>Rows of the table</source>
        <translation>Zeilen der Tabelle</translation>
    </message>
    <message>
        <source>%1 of %2 rows</source>
        <translation>%1 von %2 Zeilen</translation>
    </message>
    <message>
        <source>Export the rows shown</source>
        <translation>Die gezeigten Zeilen exportieren</translation>
    </message>
    <message>
        <source>CSV (*.csv)</source>
        <translation>CSV (*.csv)</translation>
    </message>
    <message>
        <source>The table is not shown.</source>
        <translation>Die Tabelle wird nicht gezeigt.</translation>
    </message>
    <message>
        <source>No tables yet: run a stage. detect, localize, survey and evaluate write tables into results/.</source>
        <translation>Noch keine Tabellen: eine Stufe rechnen. detect, localize, survey und evaluate schreiben Tabellen nach results/.</translation>
    </message>
    <message>
        <source>Open a project (Ctrl+O) to see the tables of its results.</source>
        <translation>Ein Projekt öffnen (Strg+O), um die Tabellen seiner Ergebnisse zu sehen.</translation>
    </message>
</context>
<context>
    <name>trigpoint::ViewCube</name>
    <message>
        <source>Direction of view</source>
        <translation>Blickrichtung</translation>
    </message>
    <message>
        <source>Look from this side (Shift with T, N, E, S, W)</source>
        <translation>Von dieser Seite sehen (Umschalt mit T, N, E, S, W)</translation>
    </message>
    <message>
        <source>E</source>
        <translation>O</translation>
    </message>
    <message>
        <source>W</source>
        <translation>W</translation>
    </message>
    <message>
        <source>N</source>
        <translation>N</translation>
    </message>
    <message>
        <source>S</source>
        <translation>S</translation>
    </message>
    <message>
        <source>top</source>
        <translation>oben</translation>
    </message>
    <message>
        <source>below</source>
        <translation>unten</translation>
    </message>
</context>
<context>
    <name>trigpoint::Workspace</name>
    <message>
        <source>The project was not opened.</source>
        <translation>Das Projekt wurde nicht geöffnet.</translation>
    </message>
    <message>
        <source>The rest of the project is open.</source>
        <translation>Der Rest des Projekts ist offen.</translation>
    </message>
    <message>
        <source>What is out of date is not known.</source>
        <translation>Was veraltet ist, ist nicht bekannt.</translation>
    </message>
</context>
</TS>
